"""One rigid pose that explains markers' corners and the depth on their faces.

Corners give direction and yaw, depth gives the range: a marker's size alone gives it only as well as it was printed.
Residuals are in standard deviations of the measurements.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from app.perception.markers.view import MarkerView
from app.pipeline.geometry import inverse_transform
from roboprompt_client.cameras.table import DEPTH_SIGMA_AT_1_M
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera

DEPTH_PATCH_PX = 25  # errors of neighboring pixels correlate: so many count as one measurement
OUTLIER_SIGMAS = 4.0
UPRIGHT_SIGMA_RAD = np.radians(0.1)
MAX_POINTS = 200  # per face; more are subsampled, with higher weights
TINY = 1e-9  # m; avoids a division by 0 where a face is seen edge-on
RIVAL_RAD = np.radians(5.0)  # closer poses count as equal
STEP = 1e-6  # rad and m, of numerical derivatives
SETTLED = 1e-7  # relative change in cost below which the optimization stops


@dataclass(frozen=True, eq=False)
class _MarkerData:
    """All measurements: C corners, and P points, each with the face on which it lies, in the object's frame.

    Attributes:
        measurements: (P,) how many independent measurements each point counts as.
    """

    camera: Camera
    corners_px: Array
    corner_sigmas_px: Array
    corners_m: Array
    points_m: Array
    face_points_m: Array
    face_normals: Array
    measurements: Array
    up_camera: Array | None

    @classmethod
    def of(cls, camera: Camera, views: Sequence[MarkerView], up_camera: Array | None) -> Self:
        points_m = [view.points_m[:: 1 + len(view.points_m) // MAX_POINTS] for view in views]
        counts = [len(points) for points in points_m]
        patches = [len(view.points_m) / DEPTH_PATCH_PX for view in views]
        to_object = [view.marker_to_object for view in views]
        corners_m = [v.corners_marker_m @ t[:3, :3].T + t[:3, 3] for v, t in zip(views, to_object, strict=True)]
        return cls(
            camera,
            np.concatenate([view.seen.corners_px for view in views]),
            np.repeat([view.seen.corner_sigma_px for view in views], 4),
            np.concatenate(corners_m),
            np.concatenate(points_m),
            np.repeat([t[:3, 3] for t in to_object], counts, axis=0),
            np.repeat([t[:3, 2] for t in to_object], counts, axis=0),
            np.repeat(np.array(patches) / counts, counts),
            up_camera,
        )


def _errors(data: _MarkerData, pose: Array) -> Array:
    """Return residuals (E,) in standard deviations: of corners, points and the upright axis."""
    camera = data.camera
    places = data.corners_m @ pose[:3, :3].T + pose[:3, 3]
    seen = places[:, :2] / places[:, 2:] * (camera.fx_px, camera.fy_px) + (camera.cx_px, camera.cy_px)
    parts = [((seen - data.corners_px) / data.corner_sigmas_px[:, None]).ravel(), _depth_errors(data, pose)]
    if data.up_camera is not None:
        parts.append(np.cross(data.up_camera, pose[:3, 2]) / UPRIGHT_SIGMA_RAD)
    return np.concatenate(parts)


def _depth_errors(data: _MarkerData, pose: Array) -> Array:
    """Return residuals (P,) of the points' distances from their faces; constant for outliers."""
    normals = data.face_normals @ pose[:3, :3].T
    on_face = data.face_points_m @ pose[:3, :3].T + pose[:3, 3]
    distances = ((data.points_m - on_face) * normals).sum(axis=1)
    sigmas = DEPTH_SIGMA_AT_1_M * data.points_m[:, 2] * np.abs((data.points_m * normals).sum(axis=1)) + TINY
    middle = np.sort(distances)[len(distances) // 2]  # while the range is wrong, all distances share an offset
    inliers = np.abs(distances - middle) < OUTLIER_SIGMAS * sigmas
    errors: Array = np.where(inliers, distances / sigmas, OUTLIER_SIGMAS) * np.sqrt(data.measurements)
    return errors


@dataclass(frozen=True, eq=False)
class MarkerFit:
    """The best pose.

    Attributes:
        object_to_camera: (4, 4).
        cost: the sum of squared errors, each in units of its standard deviation.
        corner_rms_px: the corners' distance from where the pose puts them.
        position_sigma_m: the position's standard deviation, propagated from the measurements'.
        rotation_sigma_rad: the same of its rotation.
        rival_cost: of the other pose with nearly the same image of the corners; infinite if there is none.
    """

    object_to_camera: Array
    cost: float
    corner_rms_px: float
    position_sigma_m: float
    rotation_sigma_rad: float
    rival_cost: float = np.inf


def fit_markers(camera: Camera, views: Sequence[MarkerView], up_camera: Array | None) -> MarkerFit:
    """Return the best pose of the object with the markers in `views` (one or more), each with depth on its face.

    The pose of a small square is ambiguous: both solutions of every marker are tried.

    Args:
        up_camera: (3,) direction of the object's z axis in the camera's frame, or None if it is unknown.
    """
    data = _MarkerData.of(camera, views, up_camera)
    fits = [_refined(data, start) for start in _starts(camera, views, up_camera)]
    best = min(fits, key=lambda fit: fit.cost)
    rivals = [fit.cost for fit in fits if _angle_rad(fit.object_to_camera, best.object_to_camera) > RIVAL_RAD]
    return replace(best, rival_cost=min(rivals, default=np.inf))


def _starts(camera: Camera, views: Sequence[MarkerView], up_camera: Array | None) -> list[Array]:
    """Return distinct starting poses (4, 4), object to camera."""
    starts: list[Array] = []
    for view in views:
        for marker_to_camera in view.starts(camera):
            start = marker_to_camera @ inverse_transform(view.marker_to_object)
            if up_camera is not None:
                upright, _ = Rotation.align_vectors(up_camera, start[:3, 2])
                start[:3, :3] = upright.as_matrix() @ start[:3, :3]
            if all(_angle_rad(start, other) > RIVAL_RAD for other in starts):
                starts.append(start)
    return starts


def _refined(data: _MarkerData, start: Array) -> MarkerFit:
    """Return the best pose near the start, optimized by a rotation and a translation in the camera's frame."""

    def errors(step: Array) -> Array:
        return _errors(data, _moved(start, step))

    found = least_squares(errors, np.zeros(6), method="lm", ftol=SETTLED, diff_step=STEP)
    corners = found.fun[: data.corners_px.size].reshape(-1, 2) * data.corner_sigmas_px[:, None]
    pose, spread = _moved(start, found.x), np.linalg.inv(found.jac.T @ found.jac)
    x, y, z = start[:3, 3]
    of_origin = np.hstack([[[0, z, -y], [-z, 0, x], [y, -x, 0]], np.eye(3)])  # how it moves with a step
    return MarkerFit(
        pose,
        float(found.fun @ found.fun),
        float(np.sqrt((corners**2).sum(axis=1).mean())),
        float(np.sqrt(np.trace(of_origin @ spread @ of_origin.T))),
        float(np.sqrt(np.trace(spread[:3, :3]))),
    )


def _moved(pose: Array, step: Array) -> Array:
    moved, turn = np.eye(4), cv2.Rodrigues(step[:3])[0]
    moved[:3, :3], moved[:3, 3] = turn @ pose[:3, :3], turn @ pose[:3, 3] + step[3:]
    return moved


def _angle_rad(one: Array, other: Array) -> float:
    return float(np.linalg.norm(cv2.Rodrigues(one[:3, :3].T @ other[:3, :3])[0]))
