"""Upright boxes and cylinders of known size and color, found in RGB-D images.

Where several objects look alike: groups sightings by object and selects the object that the query means.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery, model_of
from app.perception.cuboid.confidence import sighting_of_fit
from app.perception.cuboid.fit import fit_upright
from app.perception.cuboid.measurements import Measurements, measure_piece
from app.perception.cuboid.model import CuboidModel
from app.perception.cuboid.segmentation import Bytes, HsvImage, Piece, color_mask, find_pieces, to_hsv
from app.perception.frame_checks import check_cameras, check_level
from app.perception.object_model import ObjectModelError
from app.perception.sightings import Miss, Sighting, fused
from app.pipeline.errors import UncertainPoseError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.quaternions import yaw_rad

EXAMPLE = 'its size and color, e.g. {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}'
FULL_TURN_RAD = 2 * np.pi
# Sightings of two cameras belong to one object if they are closer than this share of its smaller side, plus the slack.
SAME_SHARE = 0.6
SAME_SLACK_M = 0.01
TIE_M = 0.005  # noise decides the order of two distances that differ by less


class CuboidPoses:
    """For each camera: segments the color, then fits the known shape to depth and outline.

    Objects stand upright: their z axis is the world's. The returned yaw is canonical under the shape's symmetry.
    """

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        """Return one pose for each object; see `app.perception.base.PoseEstimator`.

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
    """Return the centers (3,) of all objects that look like the model, without selection by its rank."""
    found = _instances(_Search(frames).look(model), model)
    return [best.position_m for best, *_ in found if best.confidence >= model.min_confidence]


class _Search:
    """Finds objects in one set of images; searches once for all objects that look alike."""

    def __init__(self, frames: Sequence[RgbdFrame]) -> None:
        check_cameras(frames)
        for frame in frames:
            check_level(frame)
        self._images = [(frame, to_hsv(frame.rgb)) for frame in frames if frame.rgb is not None]
        self._found: dict[CuboidModel, list[Sighting | Miss]] = {}

    def pose(self, query: ObjectQuery, model: CuboidModel, poses: Mapping[str, ObjectPose]) -> ObjectPose:
        """Return the pose of an object, given the poses of the objects that its model refers to."""
        found = self.look(model)
        anchor_m = None if model.rank is None else poses[model.rank.nearest_to].position_m
        sightings, note = _chosen(query.name, model, _instances(found, model), anchor_m)
        middle = fused(
            query,
            [*sightings, *(item for item in found if isinstance(item, Miss))],
            estimator="cuboid",
            min_confidence=model.min_confidence,
            yaw_symmetry_deg=model.shape_symmetry_deg,
        )
        if note:
            middle = replace(middle, reason="; ".join(filter(None, (middle.reason, note))))
        return _at_origin(middle, model, None if model.away_from is None else poses[model.away_from].position_m)

    def look(self, model: CuboidModel) -> list[Sighting | Miss]:
        """Return each camera's sightings of all objects that look like the model; positions are shape centers."""
        looks = replace(model, origin_m=(0.0, 0.0, 0.0), rank=None, away_from=None)
        if looks not in self._found:
            self._found[looks] = _sighted(self._images, looks)
        return self._found[looks]


def _sighted(images: Sequence[tuple[RgbdFrame, HsvImage]], looks: CuboidModel) -> list[Sighting | Miss]:
    size_m, yaw_range_rad = np.array(looks.size_m), np.radians(looks.shape_symmetry_deg) or FULL_TURN_RAD
    seen: list[tuple[RgbdFrame, Piece, Measurements]] = []
    misses = []
    for frame, hsv in images:
        mask = color_mask(hsv, looks.color)
        pieces = find_pieces(frame, mask, size_m, looks.shape)
        seen += [(frame, piece, measure_piece(frame, piece)) for piece in pieces]
        if not pieces:
            misses.append(_miss(frame, mask))
    fits = fit_upright([data for *_, data in seen], looks.shape, size_m, yaw_range_rad=yaw_range_rad)
    return [*(sighting_of_fit(*item, looks.shape, fit) for item, fit in zip(seen, fits, strict=True)), *misses]


def _miss(frame: RgbdFrame, mask: Bytes) -> Miss:
    """Return the reason why a camera has no sighting."""
    assert frame.depth_m is not None
    count = int(np.count_nonzero(mask))
    if not count:
        reason = "no pixel has its color"
    elif not (frame.depth_m[mask > 0] > 0).any():
        reason = f"the {count} pixels of its color have no depth"
    else:
        reason = f"{count} pixels have its color, but none of their patches is large enough"
    return Miss(frame.camera.name, reason)


def _in_order(models: dict[str, CuboidModel]) -> list[str]:
    """Return the objects' names, each after the objects that its model refers to.

    Raises:
        InvalidInputError: if one refers to an object that is not in the query, or references form a cycle.
    """
    references: dict[str, list[str]] = {}
    for name, model in models.items():
        named = {} if model.rank is None else {"rank.nearest_to": model.rank.nearest_to}
        if model.away_from is not None:
            named["away_from"] = model.away_from
        references[name] = list(named.values())
        for field, other in named.items():
            if other not in models:
                message = f"is {other!r}, which is not among the objects"
                raise ObjectModelError(name, message, ", ".join(models), within=field)
    try:
        return list(TopologicalSorter(references).static_order())
    except CycleError as error:
        circle = error.args[1][::-1]
        message = f"refers to itself: {' -> '.join(circle)}"
        raise ObjectModelError(circle[0], message, "no circle") from None


def _at_origin(middle: ObjectPose, model: CuboidModel, away_from_m: Array | None) -> ObjectPose:
    """Return the object's pose from the pose of its shape.

    With `away_from_m` (3,), of all yaws under the symmetry the one whose x axis points away from that place best.
    """
    assert middle.quaternion_xyzw is not None
    rotation = Rotation.from_quat(middle.quaternion_xyzw)
    if away_from_m is not None:
        away_m = middle.position_m - away_from_m
        heading_rad = float(np.arctan2(away_m[1], away_m[0]))
        if model.shape_symmetry_deg:
            yaw, period_rad = yaw_rad(rotation.as_quat()), np.radians(model.shape_symmetry_deg)
            heading_rad = yaw + round((heading_rad - yaw) / period_rad) * period_rad
        rotation = Rotation.from_euler("z", heading_rad)
    position_m = middle.position_m + rotation.apply(model.origin_m)
    return replace(middle, position_m=position_m, quaternion_xyzw=rotation.as_quat(canonical=True))


def _instances(found: Sequence[Sighting | Miss], model: CuboidModel) -> list[list[Sighting]]:
    """Return the sightings grouped by object; objects and their sightings are sorted by confidence, highest first."""
    sightings = [item for item in found if isinstance(item, Sighting)]
    reach_m = SAME_SHARE * min(model.size_m[:2]) + SAME_SLACK_M
    groups: list[list[Sighting]] = []
    for sighting in sorted(sightings, key=lambda s: -s.confidence):
        for group in groups:
            apart_m = float(np.linalg.norm(group[0].position_m - sighting.position_m))
            if apart_m < reach_m and all(sighting.camera != other.camera for other in group):
                group.append(sighting)
                break
        else:
            groups.append([sighting])
    return groups


def _chosen(
    name: str, model: CuboidModel, found: Sequence[Sequence[Sighting]], anchor_m: Array | None
) -> tuple[Sequence[Sighting], str]:
    """Return the sightings of the object that the model means, and a note if the choice was close.

    Raises:
        UncertainPoseError: if a camera sees several and the model has no rank, or their number differs from the rank's.
    """
    certain = [item for item in found if item[0].confidence >= model.min_confidence]
    if model.rank is None:
        return _only(name, certain) or (found[0] if found else ()), ""
    assert anchor_m is not None
    rank = model.rank
    if len(certain) != rank.of:
        listed = "; ".join(_described(item[0]) for item in found) or "none is seen"
        message = f"{len(certain)} things that look like it are seen well enough, not {rank.of}: {listed}"
        remedy = f"a view of all {rank.of}, to count from {rank.nearest_to}"
        raise UncertainPoseError(name, message, remedy)
    distances_m = np.array([np.linalg.norm(item[0].position_m - anchor_m) for item in certain])
    index = int(np.argsort(distances_m)[rank.number - 1])
    ties = np.count_nonzero(np.abs(distances_m - distances_m[index]) < TIE_M) - 1
    note = f"{ties} more that look like it are as far from {rank.nearest_to}, within {1000 * TIE_M:g} mm"
    return certain[index], note if ties else ""


def _only(name: str, certain: Sequence[Sequence[Sighting]]) -> list[Sighting]:
    """Return all certain sightings of the only object; `fused` refuses them if cameras contradict each other."""
    sightings = [sighting for item in certain for sighting in item]
    for camera in {sighting.camera: None for sighting in sightings}:
        seen = [s for s in sightings if s.camera == camera]
        if len(confident := [s for s in seen if s.confidence >= 0.5 * seen[0].confidence]) > 1:
            places = " and ".join(_place(s.position_m) for s in confident)
            message = f"camera {camera} sees {len(confident)} that look like it, at {places}"
            remedy = "one such object in view, a rank in its object model, or another color"
            raise UncertainPoseError(name, message, remedy)
    return sightings


def _described(sighting: Sighting) -> str:
    reason = f" ({sighting.reason})" if sighting.reason else ""
    place = _place(sighting.position_m)
    return f"{sighting.camera} sees one at {place} with confidence {sighting.confidence:.2f}{reason}"


def _place(position_m: Array) -> str:
    return "[" + ", ".join(f"{x:.2f}" for x in position_m) + "] m"
