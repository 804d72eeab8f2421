"""Positions from segmentation masks and depth, as in the authors' code; optionally the yaw of an upright box."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.cuboid.confidence import sighting_of_fit
from app.perception.cuboid.fit import fit_any_size
from app.perception.cuboid.measurements import measure_piece
from app.perception.cuboid.model import SHAPES
from app.perception.cuboid.segmentation import piece_points_m, trimmed
from app.perception.cuboid.shape import SX, YAW
from app.perception.models import MasksModel
from app.perception.sightings import Miss, Sighting, fused
from app.pipeline.errors import ObjectNotVisibleError
from app.pipeline.geometry import backproject
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose

MIN_POINTS = 40
CENTROID_CONFIDENCE = 0.7  # lower than 1, as the centroid depends on the view
CENTROID_REASON = "centroid of the visible surface, 1 to 4 cm from the middle, depends on the view"
LONGER_BY = 1.15  # least ratio of the sides to determine the heading by the longer one
ROUND_MARGIN = 0.9  # an object is round if a cylinder's cost is below this share of a box's
Mask = npt.NDArray[np.int32]


class MaskedPoints:
    """Averages an object's back-projected pixels in each camera, then the cameras' means without weights.

    Returns a position only, unless the object's model requests a rotation. The mean lies nearer to the cameras than the
    object's center, since only its visible surface counts.
    """

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        masked = [(frame, frame.mask) for frame in frames if frame.mask is not None]
        if not masked:
            raise InvalidInputError("cameras", "no camera has a mask", "mask_NAME beside depth_NAME for some camera")
        return tuple(self._pose(query, masked) for query in objects)

    def _pose(self, query: ObjectQuery, frames: Sequence[tuple[RgbdFrame, Mask]]) -> ObjectPose:
        if not query.mask_ids:
            remedy = "the ids of its pixels in the mask images, e.g. [98]"
            raise InvalidInputError(f"objects[{query.name}].mask_ids", "is missing or empty", remedy)
        means_m: dict[str, Array] = {}
        for frame, mask in frames:
            points_m = backproject(frame, np.isin(mask, query.mask_ids))
            if len(points_m):
                means_m[frame.camera.name] = points_m.mean(axis=0)
        if not means_m:
            cameras = ", ".join(frame.camera.name for frame, _ in frames)
            message = f"no camera ({cameras}) has pixels with id {list(query.mask_ids)} and known depth"
            raise ObjectNotVisibleError(query.name, message, "mask_ids that some mask image contains")
        position_m = np.mean(list(means_m.values()), axis=0)
        seeing = tuple(means_m)
        pose = ObjectPose(query.name, position_m, None, "masks", seeing, CENTROID_CONFIDENCE, CENTROID_REASON)
        if not (isinstance(query.model, MasksModel) and query.model.rotation):
            return pose
        found = [_box(query, query.model, frame) for frame, _ in frames]
        box = fused(query, found, estimator="masks", yaw_symmetry_deg=query.model.yaw_symmetry_deg)
        return replace(
            box,
            position_m=position_m,
            confidence=min(box.confidence, CENTROID_CONFIDENCE),
            reason="; ".join(filter(None, (CENTROID_REASON, box.reason))),
        )


def _box(query: ObjectQuery, model: MasksModel, frame: RgbdFrame) -> Sighting | Miss:
    """Return the upright box around the masked points; a Miss if it is round or its sides are too similar."""
    assert frame.mask is not None
    assert frame.depth_m is not None
    name, piece = frame.camera.name, trimmed(0, 0, np.isin(frame.mask, query.mask_ids), frame.depth_m)
    if len(piece_points_m(frame, piece)) < MIN_POINTS:
        return Miss(name, f"fewer than {MIN_POINTS} masked pixels have depth")
    data = measure_piece(frame, piece)
    box, cylinder = (fit_any_size(data, shape) for shape in SHAPES)
    if cylinder.cost < ROUND_MARGIN * box.cost:
        return Miss(name, "it looks round, so it has no yaw", seen=True)
    x_m, y_m, _ = box.candidate[SX:]
    ratio = max(x_m, y_m) / min(x_m, y_m)
    if model.yaw_symmetry_deg > 90 and ratio < LONGER_BY:
        return Miss(name, f"its sides of {100 * x_m:.1f} and {100 * y_m:.1f} cm are too alike for a heading", seen=True)
    yaw = box.candidate[YAW] + (np.pi / 2 if y_m > x_m else 0.0)
    turn = Rotation.from_euler("z", yaw).as_quat(canonical=True)
    return replace(sighting_of_fit(frame, piece, data, "box", box), quaternion_xyzw=turn)
