"""Upright boxes and cylinders of known size and color, found in RGB-D images."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery, model_of
from app.perception.cuboid.fit import fit_upright
from app.perception.cuboid.instances import chosen, instances
from app.perception.cuboid.judge import judge
from app.perception.cuboid.model import CuboidModel
from app.perception.cuboid.pieces import HsvImage, Piece, color_mask, find_pieces, to_hsv
from app.perception.cuboid.view import view_of
from app.perception.frame_checks import check_cameras, check_level
from app.perception.object_model import ObjectModelError
from app.perception.sightings import Miss, Sighting, fused
from app.pipeline.geometry import yaw_rad
from roboprompt_client.arrays import Array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.trajectory import ObjectPose

EXAMPLE = 'its size and color, e.g. {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}'
NAME = "cuboid"
FULL_TURN_RAD = 2 * np.pi


class CuboidPoses:
    """Color mask, then a fit of the known shape to depth and outline, camera by camera.

    Objects stand upright: their z axis is the world's. Yaws are canonical under the shape's symmetry.
    """

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        """One pose per object; see `app.perception.base.PoseEstimator`.

        Raises:
            InvalidInputError: if a query has no cuboid model, there is no camera, or a camera's images are unusable.
            ObjectNotVisibleError, UncertainPoseError: see `app.perception.sightings.fused`.
        """
        models = {query.name: model_of(query, CuboidModel, EXAMPLE) for query in objects}
        search = _Search(frames)
        found: dict[str, ObjectPose] = {}
        by_name = {query.name: query for query in objects}
        for name in _in_order(models):
            found[name] = search.pose(by_name[name], models[name], found)
        return tuple(found[query.name] for query in objects)


def likenesses(model: CuboidModel, frames: Sequence[RgbdFrame]) -> list[Array]:
    """Where (3,) things are that look like the model, whichever it means; the middles of their shapes."""
    found = instances(_Search(frames).look(_looks(model)), model)
    return [item.position_m for item in found if item.confidence >= model.min_confidence]


def _looks(model: CuboidModel) -> CuboidModel:
    """What the cameras look for: all but which of those that look alike is meant, and where its origin lies."""
    return replace(model, origin_m=(0.0, 0.0, 0.0), rank=None, away_from=None)


class _Search:
    """Finds objects in one set of images; objects that look alike are looked for once."""

    def __init__(self, frames: Sequence[RgbdFrame]) -> None:
        check_cameras(frames)
        for frame in frames:
            check_level(frame)
        self._images = [(frame, to_hsv(frame.rgb)) for frame in frames if frame.rgb is not None]
        self._found: dict[CuboidModel, list[Sighting | Miss]] = {}

    def pose(self, query: ObjectQuery, model: CuboidModel, poses: Mapping[str, ObjectPose]) -> ObjectPose:
        """The pose of an object, given those of the objects that distinguish it."""
        found = self.look(_looks(model))
        anchor_m = None if model.rank is None else poses[model.rank.nearest_to].position_m
        instance = chosen(query.name, model, instances(found, model), anchor_m)
        middle = fused(
            query,
            [*instance.sightings, *(item for item in found if isinstance(item, Miss))],
            estimator=NAME,
            min_confidence=model.min_confidence,
            yaw_symmetry_deg=model.shape_symmetry_deg,
        )
        if instance.note:
            middle = replace(middle, reason="; ".join(filter(None, (middle.reason, instance.note))))
        return _at_origin(middle, model, None if model.away_from is None else poses[model.away_from].position_m)

    def look(self, looks: CuboidModel) -> list[Sighting | Miss]:
        """What each camera makes of everything that looks so."""
        if looks not in self._found:
            self._found[looks] = [item for image in self._images for item in _sighted(*image, looks)]
        return self._found[looks]


def _sighted(frame: RgbdFrame, hsv: HsvImage, looks: CuboidModel) -> Sequence[Sighting | Miss]:
    mask = color_mask(hsv, looks.color)
    pieces = find_pieces(frame, mask, np.array(looks.size_m), looks.shape)
    return [_sighting(frame, piece, looks) for piece in pieces] or [Miss(frame.camera.name, _why_nothing(frame, mask))]


def _in_order(models: dict[str, CuboidModel]) -> list[str]:
    """The objects' names, each after those that distinguish it.

    Raises:
        InvalidInputError: if one refers to an object that is not asked for, or to itself in the end.
    """
    references = {name: _references(model) for name, model in models.items()}
    for name, found in references.items():
        for field, other in found.items():
            if other not in models:
                message = f"is {other!r}, which is not among the objects"
                raise ObjectModelError(name, message, ", ".join(models), within=field)
    try:
        return list(TopologicalSorter({name: found.values() for name, found in references.items()}).static_order())
    except CycleError as error:
        circle = error.args[1][::-1]
        message = f"refers to itself: {' -> '.join(circle)}"
        raise ObjectModelError(circle[0], message, "no circle") from None


def _references(model: CuboidModel) -> dict[str, str]:
    rank = {} if model.rank is None else {"rank.nearest_to": model.rank.nearest_to}
    return rank if model.away_from is None else {**rank, "away_from": model.away_from}


def _sighting(frame: RgbdFrame, piece: Piece, model: CuboidModel) -> Sighting:
    view = view_of(frame, piece)
    yaw_range_rad = np.radians(model.shape_symmetry_deg) or FULL_TURN_RAD
    fit = fit_upright(view, model.shape, np.array(model.size_m), yaw_range_rad=yaw_range_rad)
    verdict = judge(frame, piece, view, model.shape, fit)
    quaternion = Rotation.from_euler("z", fit.candidate[3]).as_quat(canonical=True)
    return Sighting(frame.camera.name, fit.candidate[:3], quaternion, verdict.confidence, verdict.reason)


def _why_nothing(frame: RgbdFrame, mask: np.ndarray) -> str:
    assert frame.depth_m is not None
    count = int(np.count_nonzero(mask))
    if not count:
        return "no pixel has its color"
    if not (frame.depth_m[mask > 0] > 0).any():
        return f"the {count} pixels of its color have no depth"
    return f"{count} pixels have its color, but none of their patches is large enough"


def _at_origin(middle: ObjectPose, model: CuboidModel, away_from_m: Array | None) -> ObjectPose:
    """The object's own pose from that of its shape."""
    assert middle.quaternion_xyzw is not None
    rotation = Rotation.from_quat(middle.quaternion_xyzw)
    if away_from_m is not None:
        rotation = _turned_away(rotation, middle.position_m - away_from_m, model.shape_symmetry_deg)
    position_m = middle.position_m + rotation.apply(model.origin_m)
    return replace(middle, position_m=position_m, quaternion_xyzw=rotation.as_quat(canonical=True))


def _turned_away(rotation: Rotation, away: Array, symmetry_deg: float) -> Rotation:
    """Of the yaws that look alike the one whose x axis points most along `away`."""
    heading_rad = float(np.arctan2(away[1], away[0]))
    if symmetry_deg == 0:
        return Rotation.from_euler("z", heading_rad)
    period_rad = np.radians(symmetry_deg)
    yaw = yaw_rad(rotation)
    return Rotation.from_euler("z", yaw + round((heading_rad - yaw) / period_rad) * period_rad)
