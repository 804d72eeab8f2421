"""Two calibrated cameras, in OpenCV axes (x right, y down, z forward); MuJoCo's cameras look along -z."""

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.arrays import Array
from app.pipeline.camera import Camera

WIDTH_PX, HEIGHT_PX = 640, 480
OPENCV_TO_MUJOCO = np.diag([1.0, -1.0, -1.0])  # the camera's axes: y up instead of down, z backward instead of forward


@dataclass(frozen=True)
class View:
    """Where a camera stands and looks, m in the world frame, and its vertical field of view."""

    eye_m: tuple[float, float, float]
    target_m: tuple[float, float, float]
    vertical_fov_deg: float


# `front` looks at the robot from the front left; `left_shoulder` over the arm from behind, like RLBench's camera
VIEWS = {
    "front": View((0.75, 1.10, 1.45), (0.02, -0.08, 0.95), 45.0),
    "left_shoulder": View((-0.45, 0.75, 1.55), (0.17, -0.06, 0.83), 42.0),
}
CAMERA_NAMES = tuple(VIEWS)


def add_cameras(spec: mujoco.MjSpec) -> None:
    """Add the cameras to a mujoco.MjSpec."""
    for name, view in VIEWS.items():
        x, y, z, w = Rotation.from_matrix(camera_to_world(view)[:3, :3] @ OPENCV_TO_MUJOCO).as_quat()
        spec.worldbody.add_camera(name=name, pos=view.eye_m, quat=[w, x, y, z], fovy=view.vertical_fov_deg)


def calibrated(name: str, width_px: int = WIDTH_PX, height_px: int = HEIGHT_PX) -> Camera:
    """A camera's calibration. Pixel centres are whole numbers: the optical axis meets the image at (size - 1) / 2."""
    view = VIEWS[name]
    focal_px = height_px / 2 / np.tan(np.radians(view.vertical_fov_deg) / 2)
    return Camera(name, focal_px, focal_px, (width_px - 1) / 2, (height_px - 1) / 2, camera_to_world(view))


def camera_to_world(view: View) -> Array:
    """(4, 4) from OpenCV camera axes to the world frame, the image's horizon level."""
    eye = np.array(view.eye_m)
    forward = np.array(view.target_m) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    transform: Array = np.eye(4)
    transform[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    transform[:3, 3] = eye
    return transform
