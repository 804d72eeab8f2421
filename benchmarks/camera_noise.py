"""What a depth camera adds to a rendered image."""

from dataclasses import replace

import cv2
import numpy as np

from roboprompt_client.types.camera import RgbdFrame

DEPTH_SIGMA_PER_M = 0.002  # a stereo depth camera's error grows with the square of the distance
CORRELATION_PX = 1.5  # of neighboring pixels' errors: stereo matching compares windows
FLYING_STEP_M = 0.01  # beside a step in depth, pixels float between the two sides
QUANTUM_M = 0.001
RGB_SIGMA = 3.0


def as_a_camera_sees_it(frame: RgbdFrame, random: np.random.Generator) -> RgbdFrame:
    """The frame with noise on colors (sigma 3 of 255) and depth.

    Depth errors have sigma 2 mm * z^2, are correlated over 1.5 px, pixels at edges fly, and depth comes in 1 mm steps.
    """
    assert frame.rgb is not None
    assert frame.depth_m is not None
    rgb = np.clip(frame.rgb + random.normal(0, RGB_SIGMA, frame.rgb.shape), 0, 255).astype(np.uint8)
    true_m, known = frame.depth_m, frame.depth_m > 0
    mean_m = cv2.blur(true_m, (3, 3))
    depth_m = np.where(np.abs(true_m - mean_m) > FLYING_STEP_M, mean_m, true_m)
    error = cv2.GaussianBlur(random.standard_normal(true_m.shape).astype(np.float32), (0, 0), CORRELATION_PX)
    depth_m = depth_m + error / error.std() * DEPTH_SIGMA_PER_M * depth_m**2
    depth_m = np.round(depth_m / QUANTUM_M) * QUANTUM_M
    return replace(frame, rgb=rgb, depth_m=np.where(known, depth_m, 0).astype(np.float32))
