"""One rigid pose that explains markers' corners and the depth on their faces.

Corners give direction and yaw, depth gives the range: a marker's size alone gives it only as well as it was printed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from app.perception.marker_errors import MarkerData, cross_matrices, marker_errors
from app.perception.marker_view import MarkerView
from app.perception.rigid import inverse
from app.pipeline.arrays import Array
from app.pipeline.camera import Camera

RIVAL_RAD = np.radians(5.0)  # poses that differ by less are one
MAX_ROUNDS = 12
FIRST_DAMPING = 1e-3
CONVERGED = 1e-5  # rad and m
TINY = 1e-9  # keeps from dividing by zero where directions agree


@dataclass(frozen=True, eq=False)
class MarkerFit:
    """The best pose.

    Attributes:
        object_to_camera: (4, 4).
        cost: the sum of squared errors, each in units of its standard deviation.
        corner_rms_px: the corners' distance from where the pose puts them.
        position_sigma_m: the position's standard deviation, as the measurements' own suggest.
        rotation_sigma_rad: the same of its rotation.
        rival_cost: that of the other pose from which the corners look nearly the same; infinite if there is none.
    """

    object_to_camera: Array
    cost: float
    corner_rms_px: float
    position_sigma_m: float
    rotation_sigma_rad: float
    rival_cost: float = np.inf


def fit_markers(camera: Camera, views: Sequence[MarkerView], up_camera: Array | None) -> MarkerFit:
    """The best pose of the object that carries the markers in `views`, at least one, each with depth on its face.

    A small square looks nearly the same from two sides: both are tried, for every marker.

    Args:
        up_camera: (3,) where the object's z axis points, in the camera's frame; None where that is not known.
    """
    data = MarkerData.of(camera, views, up_camera)
    fits = [_refined(data, start) for start in _starts(camera, views, up_camera)]
    best = min(fits, key=lambda fit: fit.cost)
    rivals = [fit.cost for fit in fits if _angle_rad(fit.object_to_camera, best.object_to_camera) > RIVAL_RAD]
    return replace(best, rival_cost=min(rivals, default=np.inf))


def _starts(camera: Camera, views: Sequence[MarkerView], up_camera: Array | None) -> list[Array]:
    """Poses (4, 4), object to camera, that differ."""
    starts: list[Array] = []
    for view in views:
        for marker_to_camera in view.starts(camera):
            start = marker_to_camera @ inverse(view.marker_to_object)
            if up_camera is not None:
                start[:3, :3] = _between(start[:3, 2], up_camera) @ start[:3, :3]
            if all(_angle_rad(start, other) > RIVAL_RAD for other in starts):
                starts.append(start)
    return starts


def _between(one: Array, other: Array) -> Array:
    """The smallest turn (3, 3) that brings one unit vector to another."""
    axis = np.cross(one, other)
    sine = float(np.linalg.norm(axis))
    angle_rad = np.arctan2(sine, one @ other)
    return np.asarray(cv2.Rodrigues(axis / max(sine, TINY) * angle_rad)[0], np.float64)


def _refined(data: MarkerData, start: Array) -> MarkerFit:
    """Levenberg-Marquardt on a small turn and shift in the camera's frame."""
    pose, damping = start, FIRST_DAMPING
    errors, slopes = marker_errors(data, pose)
    for _ in range(MAX_ROUNDS):
        normal = slopes.T @ slopes
        damped = normal + damping * np.diag(np.diag(normal))
        step: Array = np.linalg.solve(damped, -slopes.T @ errors).astype(np.float64, copy=False)
        moved = _moved(pose, step)
        new_errors, new_slopes = marker_errors(data, moved)
        if not new_errors @ new_errors <= errors @ errors:  # not a number, either
            damping *= 10
            continue
        pose, errors, slopes, damping = moved, new_errors, new_slopes, damping / 10
        if np.abs(step).max() < CONVERGED:
            break
    return _fit(data, pose, errors, slopes)


def _fit(data: MarkerData, pose: Array, errors: Array, slopes: Array) -> MarkerFit:
    corners = errors[: data.corners_px.size].reshape(-1, 2) * data.corner_sigmas_px[:, None]
    spread = np.linalg.inv(slopes.T @ slopes)
    of_origin = np.hstack([-cross_matrices(pose[None, :3, 3])[0], np.eye(3)])
    return MarkerFit(
        pose,
        float(errors @ errors),
        float(np.sqrt((corners**2).sum(axis=1).mean())),
        float(np.sqrt(np.trace(of_origin @ spread @ of_origin.T))),
        float(np.sqrt(np.trace(spread[:3, :3]))),
    )


def _moved(pose: Array, step: Array) -> Array:
    turn = cv2.Rodrigues(step[:3])[0]
    moved = np.eye(4)
    moved[:3, :3] = turn @ pose[:3, :3]
    moved[:3, 3] = turn @ pose[:3, 3] + step[3:]
    return moved


def _angle_rad(one: Array, other: Array) -> float:
    return float(np.linalg.norm(cv2.Rodrigues(one[:3, :3].T @ other[:3, :3])[0]))
