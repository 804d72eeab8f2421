"""What depth cameras and their calibration add to a rendered image."""

from dataclasses import replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame

DEPTH_SIGMA_PER_M = 0.002  # a stereo depth camera's error grows with the square of the distance
CORRELATION_PX = 1.5  # of neighboring pixels' errors: stereo matching compares windows
FLYING_STEP_M = 0.01  # beside a step in depth, pixels float between the two sides
QUANTUM_M = 0.001
RGB_SIGMA = 3.0
BASELINE_M = 0.05  # of a D435
CALIBRATION_DEG, CALIBRATION_M = 0.15, 0.001  # sigmas: errors of 0.07 to 0.31 degrees


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


def miscalibrated(camera: Camera, rng: np.random.Generator) -> Camera:
    """Return the camera with a pose that calibration got wrong by 0.07 to 0.31 degrees and about 1 mm."""
    pose = camera.camera_to_world.copy()
    turn = Rotation.from_rotvec(np.radians(CALIBRATION_DEG) * rng.normal(0, 0.6, 3))
    pose[:3, :3] = turn.as_matrix() @ pose[:3, :3]
    pose[:3, 3] += rng.normal(0, CALIBRATION_M, 3)
    return replace(camera, camera_to_world=pose)


def as_d435(frame: RgbdFrame, rng: np.random.Generator) -> RgbdFrame:
    """Return the frame with a D435's disparity noise (correlated, 1/32 px steps), fat edges and holes."""
    depth = frame.depth_m
    assert depth is not None
    assert frame.rgb is not None
    depth = np.where(depth > 0, depth, 5).astype(np.float32)
    scale = frame.camera.fx_px * BASELINE_M

    def white(sigma: float) -> Array:
        return cv2.GaussianBlur(rng.standard_normal(depth.shape).astype(np.float32), (0, 0), sigma)

    fat = cv2.erode(depth, np.ones((3, 3)))
    z = np.where((depth - fat > 0.01) & (white(2) > 0), fat, depth)
    error = white(1.5)
    disparity = scale / z + 0.08 * error / error.std() + rng.normal(0, 0.02)
    z = (scale / (np.round(disparity * 32) / 32)).astype(np.float32)
    near, far = cv2.erode(z, np.ones((3, 3))), cv2.dilate(z, np.ones((3, 3)))
    is_edge, dice = far - near > 0.015, rng.random(z.shape)
    z = np.where(is_edge & (dice < 0.15), near + (far - near) * (dice / 0.15), z)
    shadow = np.zeros(z.shape, bool)
    step = np.diff(scale / depth, axis=1)
    for row, column in np.argwhere(step > 0.5):
        shadow[row, max(0, column + 1 - int(step[row, column])) : column + 1] = True
    hole = shadow | (is_edge & (dice > 0.7)) | (white(3) * 10.6 > 3.2)
    z = np.where(hole | (frame.depth_m == 0), 0, np.round(z * 1000) / 1000).astype(np.float32)
    rgb = np.clip(frame.rgb + rng.normal(0, 3, frame.rgb.shape), 0, 255).astype(np.uint8)
    return replace(frame, depth_m=z, rgb=rgb)
