"""Checks of RGB-D frames before estimation: color, usable depth, and a plausible camera pose.

Tables and floors are level: if a camera sees them tilted, its calibration is wrong.
"""

from collections.abc import Sequence

import numpy as np

from roboprompt_client.cameras.table import find_flat_surface
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame

NEAREST_M, FARTHEST_M = 0.05, 20.0  # bounds of the median depth of a robot's workspace
MAX_BELOW_M = 4.0  # largest height of a camera above table or floor; a depth scale ten times too large exceeds it
DEPTH_UNITS = "meters in a .npy array; a 16-bit PNG in units of depth_scale, 0.001 for millimeters"
# Red's and blue's shares change places: by at least the first in all, and to within this part of the change.
LEAST_SWAP, MIRRORED = 0.03, 0.25  # shadows and lamps change shares less
MAX_TILT_DEG, STEEP_DEG = 5.0, 40.0  # beyond the latter it is a wall or a ramp, not a table


def check_cameras(frames: Sequence[RgbdFrame]) -> None:
    """Refuse an empty list of cameras, and frames that `check_rgbd` refuses.

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
        raise InvalidInputError(f"depth_{name}", f"{message} (median); the scale is wrong", DEPTH_UNITS)


def check_level(frame: RgbdFrame) -> None:
    """Refuse a frame whose largest flat surface is slightly tilted, above the camera or far below it.

    A frame without a flat surface passes.

    Raises:
        InvalidInputError: naming the camera's camera_to_world and the tilt, or its depth image.
    """
    surface = find_flat_surface(frame)
    if surface is None or surface.tilt_deg >= STEEP_DEG:
        return
    name = frame.camera.name
    field = f"cameras[{name}].camera_to_world"
    if surface.is_above_the_camera:
        above_m = float(surface.middle_m[2] - surface.sees_m[2])
        message = f"would put the largest flat surface that {name} sees {above_m:.2f} m above it: OpenGL's axes?"
        raise InvalidInputError(field, message, "OpenCV axes: x right, y down, z forward (OpenGL has y up, z back)")
    if (below_m := float(surface.sees_m[2] - surface.middle_m[2])) > MAX_BELOW_M:
        message = f"puts the largest flat surface that {name} sees {below_m:.1f} m below it; the scale is wrong"
        raise InvalidInputError(f"depth_{name}", message, DEPTH_UNITS)
    if surface.tilt_deg > MAX_TILT_DEG:
        message = f"would tilt the largest flat surface that {name} sees by {surface.tilt_deg:.0f} degrees"
        remedy = "pose and intrinsics of the camera that took the image, in a world whose z is up; images not swapped"
        raise InvalidInputError(field, message, remedy)


def are_swapped(usual_rgb: Array, rgb: Array) -> bool:
    """Return whether a color (3,) is the usual one with red and blue exchanged, at any brightness."""
    usual, seen = (color / max(float(color.sum()), 1.0) for color in (usual_rgb, rgb))
    off, off_swapped = np.linalg.norm(seen - usual), np.linalg.norm(seen[::-1] - usual)
    return bool(off > LEAST_SWAP and off_swapped < MIRRORED * off)
