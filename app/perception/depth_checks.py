"""Images that cannot show what an estimator looks for, each refused for what is wrong with it."""

import numpy as np

from app.pipeline.camera import RgbdFrame
from app.pipeline.errors import InvalidInputError

NEAREST_M, FARTHEST_M = 0.05, 20.0  # the middle depth of a robot's workspace lies between


def check_rgbd(frame: RgbdFrame) -> None:
    """Refuse a frame without colours or without usable depth.

    Raises:
        InvalidInputError: naming rgb_NAME, depth_NAME or the camera's depth_scale.
    """
    name = frame.camera.name
    if frame.rgb is None:
        raise InvalidInputError(f"rgb_{name}", "is missing", "a colour image beside the depth image")
    if frame.depth_m is None:
        raise InvalidInputError(f"depth_{name}", "is missing", "a depth image beside the colour image")
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
