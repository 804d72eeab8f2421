"""The yaw of an upright box around an object's masked points, where it has one."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.cuboid_fit import fit_any_size
from app.perception.cuboid_judge import judge
from app.perception.cuboid_view import view_of
from app.perception.masks_model import MasksModel
from app.perception.pieces import Piece, piece_points_m, trimmed
from app.perception.sightings import Miss, Sighting, fused
from app.perception.upright_shape import SHAPES, SX, YAW
from app.pipeline.arrays import Array
from app.pipeline.camera import RgbdFrame
from app.pipeline.episode import ObjectPose

MIN_POINTS = 40
LONGER_BY = 1.15  # a longer side gives a heading from this ratio on
ROUND_MARGIN = 0.9  # a cylinder that explains the points this much better than a box: the object is round


def box_around(query: ObjectQuery, model: MasksModel, frames: Sequence[RgbdFrame]) -> ObjectPose:
    """The pose of the box's middle, from every camera whose mask shows the object.

    Raises:
        ObjectNotVisibleError: if no camera shows enough of it.
        UncertainPoseError: if it is round, no box fits, or its sides are too alike for a heading.
    """
    sightings: list[Sighting] = []
    misses: list[Miss] = []
    for frame in frames:
        assert frame.mask is not None
        assert frame.depth_m is not None
        piece = trimmed(0, 0, np.isin(frame.mask, query.mask_ids), frame.depth_m)
        if len(piece_points_m(frame, piece)) < MIN_POINTS:
            misses.append(Miss(frame.camera.name, f"fewer than {MIN_POINTS} masked pixels have depth"))
            continue
        found = _box(frame, piece, model)
        (sightings if isinstance(found, Sighting) else misses).append(found)  # type: ignore[arg-type]
    return fused(query, sightings, misses, estimator="masks", yaw_symmetry_deg=model.yaw_symmetry_deg)


def _box(frame: RgbdFrame, piece: Piece, model: MasksModel) -> Sighting | Miss:
    view, name = view_of(frame, piece), frame.camera.name
    box, cylinder = (fit_any_size(view, shape) for shape in SHAPES)
    if cylinder.cost < ROUND_MARGIN * box.cost:
        return Miss(name, "it looks round, so it has no yaw", seen=True)
    x_m, y_m, _ = box.candidate[SX:]
    ratio = max(x_m, y_m) / min(x_m, y_m)
    if model.yaw_symmetry_deg > 90 and ratio < LONGER_BY:
        return Miss(name, f"its sides of {100 * x_m:.1f} and {100 * y_m:.1f} cm are too alike for a heading", seen=True)
    verdict = judge(frame, piece, view, "box", box)
    yaw = box.candidate[YAW] + (np.pi / 2 if y_m > x_m else 0.0)
    turn: Array = Rotation.from_euler("z", yaw).as_quat(canonical=True)
    return Sighting(name, box.candidate[:3], turn, verdict.confidence, verdict.reason)
