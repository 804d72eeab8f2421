"""Poses from ArUco or AprilTag markers on the objects, or on fixtures that hold them.

Each comes with how far it can be trusted, and why not further.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery, model_of
from app.perception.frame_checks import check_cameras
from app.perception.markers.fit import MarkerFit, fit_markers
from app.perception.markers.model import MarkersModel
from app.perception.markers.view import MarkerView, SeenMarker, face_points_m, find_markers
from app.perception.object_model import ObjectModelError
from app.perception.sightings import Miss, Sighting, fused
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import ObjectPose

# From the first value, which takes nothing away, to the second, which takes everything. Chosen by what a 5 cm cube's
# grasp forgives; on renderings with a D400's noise a marker of 20 px has 0.04 px, 0.7 mm and 0.6 degrees.
CORNER_RMS_PX = (0.5, 3.0)
POSITION_SIGMA_M = (0.005, 0.02)
ROTATION_SIGMA_DEG = (3.0, 12.0)
RANGE_DISAGREEMENT = (0.05, 0.15)
RIVAL_SCALE = 4.0  # confidence tanh(d / 4) is 2 p - 1, p the better pose's probability when costs differ by d
MIN_FACE_POINTS = 8

EXAMPLE = '{"estimator": "markers", "dictionary": "DICT_4X4_50", "markers": [{"id": 0, "size_m": 0.04}]}'


class MarkerPoses:
    """Finds objects by their markers: direction and yaw from the corners, the range from the depth on them.

    All of an object's markers that a camera sees are used together; several cameras' poses are fused.
    """

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        models = [model_of(query, MarkersModel, EXAMPLE) for query in objects]
        _check_shared(objects, models)
        check_cameras(frames)
        wanted: dict[str, set[int]] = {}  # ids to look for, by dictionary
        for model in models:
            wanted.setdefault(model.dictionary, set()).update(marker.id for marker in model.markers)
        seen = [
            (frame, {dictionary: find_markers(frame.rgb, dictionary, ids) for dictionary, ids in wanted.items()})
            for frame in frames
            if frame.rgb is not None
        ]
        poses = []
        for query, model in zip(objects, models, strict=True):
            found = [_look(model, frame, markers[model.dictionary]) for frame, markers in seen]
            poses.append(fused(query, found, estimator="markers", min_confidence=model.min_confidence))
        return tuple(poses)


def _check_shared(objects: Sequence[ObjectQuery], models: Sequence[MarkersModel]) -> None:
    named = [(query.name, model) for query, model in zip(objects, models, strict=True)]
    for (one, first), (other, second) in combinations(named, 2):
        # a fixture's marker may serve several objects, but not with the same place on each
        shared = set(first.markers) & set(second.markers) if first.dictionary == second.dictionary else set()
        if shared:
            message = f"has marker {min(item.id for item in shared)} where {one!r} has it"
            raise ObjectModelError(other, message, "another id or marker_to_object", within="markers")


def _look(model: MarkersModel, frame: RgbdFrame, seen: Sequence[SeenMarker]) -> Sighting | Miss:
    """What one camera makes of one object."""
    camera = frame.camera
    known = {marker.id: marker for marker in model.markers}
    mine = [item for item in seen if item.id in known]
    listed = _listed(known)
    if not mine:
        return Miss(camera.name, f"no {listed} of {model.dictionary} in its image")
    if repeated := [id_ for id_, count in Counter(item.id for item in mine).items() if count > 1]:
        return Miss(camera.name, f"{_listed(repeated)} is in its image more than once", seen=True)
    views = [MarkerView(known[item.id], item, face_points_m(frame, item.corners_px)) for item in mine]
    views = [view for view in views if len(view.points_m) >= MIN_FACE_POINTS]
    if not views:
        return Miss(camera.name, f"no depth is known on {_listed([item.id for item in mine])}", seen=True)
    for view in views:
        if contradiction := depth_contradiction(camera, view):
            return Miss(camera.name, contradiction, seen=True)
    fit = fit_markers(camera, views, camera.camera_to_world[2, :3] if model.upright else None)
    object_to_world = camera.camera_to_world @ fit.object_to_camera
    certain, reason = confidence(camera, fit, views)
    quaternion = Rotation.from_matrix(object_to_world[:3, :3]).as_quat(canonical=True)
    return Sighting(camera.name, object_to_world[:3, 3], quaternion, certain, reason)


def _listed(ids: Sequence[int] | Mapping[int, object]) -> str:
    numbers = ", ".join(map(str, ids))
    return f"marker {numbers}" if len(ids) == 1 else f"markers {numbers}"


def depth_contradiction(camera: Camera, view: MarkerView) -> str:
    """What is wrong if the marker's depth cannot be that of a marker of its size; empty if it can."""
    by_depth_m, by_size_m = _ranges_m(camera, view)
    if abs(by_depth_m / by_size_m - 1) <= RANGE_DISAGREEMENT[1]:
        return ""
    marker = view.marker
    return (
        f"marker {marker.id} is {by_depth_m:.3g} m away by depth, but {by_size_m:.3g} m by its size of "
        f"{marker.size_m:g} m: check depth_scale, size_m and the intrinsics"
    )


def confidence(camera: Camera, fit: MarkerFit, views: Sequence[MarkerView]) -> tuple[float, str]:
    """0..1, and what lowers it most; nothing above 0.99."""
    ratios = [by_depth_m / by_size_m for by_depth_m, by_size_m in (_ranges_m(camera, view) for view in views)]
    ratio = max(ratios, key=lambda item: abs(item - 1))
    rotation_deg = math.degrees(fit.rotation_sigma_rad)
    factors = [
        (_share(fit.corner_rms_px, CORNER_RMS_PX), f"corners lie {fit.corner_rms_px:.1f} px off the pose"),
        (_share(fit.position_sigma_m, POSITION_SIGMA_M), f"its place is known to {100 * fit.position_sigma_m:.1f} cm"),
        (_share(rotation_deg, ROTATION_SIGMA_DEG), f"its rotation is known to {rotation_deg:.0f} degrees"),
        (_share(abs(ratio - 1), RANGE_DISAGREEMENT), f"depth and a marker's size differ by {100 * (ratio - 1):+.0f} %"),
        (math.tanh((fit.rival_cost - fit.cost) / RIVAL_SCALE), "two tilts explain what is seen about as well"),
    ]
    lowest, reason = min(factors)
    return lowest, reason if lowest < 0.99 else ""


def _ranges_m(camera: Camera, view: MarkerView) -> tuple[float, float]:
    """The marker's depth as measured on its face, and as its corners and size say."""
    return float(np.median(view.points_m[:, 2])), float(view.starts(camera)[0][2, 3])


def _share(value: float, bounds: tuple[float, float]) -> float:
    none, all_ = bounds
    return float(np.clip((all_ - value) / (all_ - none), 0.0, 1.0))
