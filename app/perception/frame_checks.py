"""Checks of RGB-D frames before estimation: color and usable depth are there, and the camera's pose is plausible.

Tables and floors are level: a camera that sees them tilted is not where its calibration says.
"""

from collections.abc import Sequence

import numpy as np

from app.pipeline.geometry import pixels_to_world
from roboprompt_client.arrays import Array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.errors import InvalidInputError

NEAREST_M, FARTHEST_M = 0.05, 20.0  # the middle depth of a robot's workspace lies between
GRID_ROWS = 30  # of pixels that are looked at
NUM_TRIALS = 60
# Standard deviation of a stereo camera's depth (Intel D400) at 1 m; it grows with the square of the distance
DEPTH_SIGMA_AT_1_M = 0.002
FLAT_M = 3 * DEPTH_SIGMA_AT_1_M  # points nearer to a plane than this, at 1 m, belong to it
ENOUGH_SHARE = 0.25  # of the points, for a plane to count as table or floor
MAX_TILT_DEG, STEEP_DEG = 5.0, 40.0  # beyond the latter it is a wall or a ramp, not a table


def check_cameras(frames: Sequence[RgbdFrame]) -> None:
    """Refuse no camera at all, and what `check_rgbd` refuses.

    Raises:
        InvalidInputError: naming cameras, or as `check_rgbd`.
    """
    if not frames:
        raise InvalidInputError("cameras", "there is none", "rgb_NAME and depth_NAME of at least one camera")
    for frame in frames:
        check_rgbd(frame)


def check_rgbd(frame: RgbdFrame) -> None:
    """Refuse a frame without colors or without usable depth.

    Raises:
        InvalidInputError: naming rgb_NAME, depth_NAME or the camera's depth_scale.
    """
    name = frame.camera.name
    if frame.rgb is None:
        raise InvalidInputError(f"rgb_{name}", "is missing", "a color image beside the depth image")
    if frame.depth_m is None:
        raise InvalidInputError(f"depth_{name}", "is missing", "a depth image beside the color image")
    sample = frame.depth_m[::4, ::4]
    known = sample[sample > 0]
    if not len(known):
        raise InvalidInputError(
            f"depth_{name}", "is 0 (unknown) everywhere", "depths of the scene, 0 only where unknown"
        )
    middle_m = float(np.median(known))
    if not NEAREST_M < middle_m < FARTHEST_M:
        message = f"puts half of the scene farther than {middle_m:.3g} m" if middle_m > 1 else f"is {middle_m:.3g} m"
        remedy = "metres in a .npy array; a 16-bit PNG in units of depth_scale, 0.001 for millimetres"
        raise InvalidInputError(f"depth_{name}", f"{message} (median); the scale is wrong", remedy)


def check_level(frame: RgbdFrame) -> None:
    """Refuse a frame whose largest flat surface is nearly level, but not level; where there is none, nothing is known.

    Raises:
        InvalidInputError: naming the camera's camera_to_world and the tilt.
    """
    assert frame.depth_m is not None
    stride_px = max(1, frame.depth_m.shape[0] // GRID_ROWS)
    depth_m = frame.depth_m[::stride_px, ::stride_px]
    rows, columns = np.nonzero(depth_m > 0)
    if len(rows) < NUM_TRIALS:
        return
    depths_m = depth_m[rows, columns]
    points_m = pixels_to_world(frame.camera, rows * stride_px, columns * stride_px, depths_m)
    normal, share = _largest_plane(points_m, FLAT_M * np.maximum(depths_m.astype(np.float64), 1.0) ** 2)
    tilt_deg = float(np.degrees(np.arccos(np.clip(abs(normal[2]), 0, 1))))
    if share > ENOUGH_SHARE and MAX_TILT_DEG < tilt_deg < STEEP_DEG:
        name = frame.camera.name
        message = f"would tilt the largest flat surface that {name} sees by {tilt_deg:.0f} degrees"
        remedy = "the pose of the camera that took the image, in a world whose z axis is vertical; images not swapped"
        raise InvalidInputError(f"cameras[{name}].camera_to_world", message, remedy)


def _largest_plane(points_m: Array, tolerance_m: Array) -> tuple[Array, float]:
    """Unit normal (3,) of the plane near most points, and their share."""
    triples = np.random.default_rng(0).integers(len(points_m), size=(NUM_TRIALS, 3))
    corners = points_m[triples]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    offsets_m = np.abs(points_m @ normals.T - (corners[:, 0] * normals).sum(axis=1))
    near = offsets_m < tolerance_m[:, None]
    chosen = near[:, int(near.sum(axis=0).argmax())]
    inliers = points_m[chosen]
    _, _, axes = np.linalg.svd(inliers - inliers.mean(axis=0), full_matrices=False)
    normal: Array = axes[2]
    return normal, float(chosen.mean())
