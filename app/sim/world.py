"""The room around every task: floor, table, lights, two calibrated cameras and the arm at home.

Cameras have OpenCV axes (x right, y down, z forward); MuJoCo's cameras look along -z.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from app.sim import panda
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera

WIDTH_PX, HEIGHT_PX = 640, 480
OPENCV_TO_MUJOCO = np.diag([1.0, -1.0, -1.0])  # the camera's axes: y up instead of down, z backward instead of forward
TABLE_TOP_M = 0.752  # RLBench's table
BASE_POSITION_M = (-0.3, 0.0, TABLE_TOP_M)  # RLBench's Panda stands 0.3 m behind the workspace's origin
TIMESTEP_S = 0.002
# The tool points down at (0.007, 0, 1.239) m: above the objects and out of the front camera's sight of them
HOME_RAD = panda.READY_RAD
OBJECT_CONTACT = {"contype": 2, "conaffinity": 3}  # the room's is 3 and 3: it touches robot and objects
MAIN_LIGHT_DIRECTION = (-0.25, -0.4, -1.0)
SKY_RGB = (0.80, 0.85, 0.90)
_SKY, _LIGHT = (" ".join(map(str, numbers)) for numbers in (SKY_RGB, MAIN_LIGHT_DIRECTION))
_THICK_M = 0.04  # the table's top
_LEG_M = TABLE_TOP_M - _THICK_M
# Elliptic cones and a high impratio keep grasped objects from slipping (MuJoCo documentation, "Slippage"). With a small
# shadow map and no multisampling a 640x480 image on a CPU takes 22 instead of 92 ms.
ROOM = f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{TIMESTEP_S}" integrator="implicitfast" cone="elliptic" impratio="10"/>
  <statistic extent="1" center="0.2 0 1"/>
  <visual>
    <map znear="0.05" zfar="12"/>
    <quality shadowsize="1024" offsamples="0"/>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.15 0.15 0.15" specular="0 0 0"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="{_SKY}" rgb2="{_SKY}" width="64" height="64"/>
  </asset>
  <default>
    <default class="room">
      <geom type="box" contype="3" conaffinity="3" rgba="0.55 0.48 0.4 1"/>
    </default>
  </default>
  <worldbody>
    <light type="directional" pos="0.5 1 2.8" dir="{_LIGHT}" diffuse="0.55 0.55 0.55"/>
    <light type="directional" pos="0 -1 2.8" dir="0.2 0.4 -1" diffuse="0.25 0.25 0.25" castshadow="false"/>
    <geom class="room" name="floor" type="plane" size="6 6 0.1" rgba="0.5 0.52 0.55 1"/>
    <geom class="room" name="table" size="0.55 0.65 {_THICK_M / 2}"
      pos="0.15 0 {TABLE_TOP_M - _THICK_M / 2}" rgba="0.76 0.68 0.57 1" friction="0.8 0.005 0.0001"/>
    <geom class="room" size="0.03 0.03 {_LEG_M / 2}" pos="-0.34 -0.59 {_LEG_M / 2}"/>
    <geom class="room" size="0.03 0.03 {_LEG_M / 2}" pos="-0.34 0.59 {_LEG_M / 2}"/>
    <geom class="room" size="0.03 0.03 {_LEG_M / 2}" pos="0.64 -0.59 {_LEG_M / 2}"/>
    <geom class="room" size="0.03 0.03 {_LEG_M / 2}" pos="0.64 0.59 {_LEG_M / 2}"/>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True)
class CameraPlacement:
    """The position and target of a camera, m in the world frame, and its vertical field of view."""

    eye_m: tuple[float, float, float]
    target_m: tuple[float, float, float]
    vertical_fov_deg: float


# `front` looks at the robot from the front left; the others over the arm from behind, like RLBench's cameras
CAMERAS = {
    "front": CameraPlacement((0.75, 1.10, 1.45), (0.02, -0.08, 0.95), 45.0),
    "left_shoulder": CameraPlacement((-0.45, 0.75, 1.55), (0.17, -0.06, 0.83), 42.0),
    "right_shoulder": CameraPlacement((-0.45, -0.75, 1.55), (0.17, 0.06, 0.83), 42.0),
}
CAMERA_NAMES = tuple(CAMERAS)[:2]  # that take pictures unless more are asked for


def calibrated(name: str) -> Camera:
    """A camera's calibration. Pixel centers are whole numbers: the optical axis meets the image at (size - 1) / 2."""
    placement = CAMERAS[name]
    focal_px = HEIGHT_PX / 2 / np.tan(np.radians(placement.vertical_fov_deg) / 2)
    return Camera(name, focal_px, focal_px, (WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2, camera_to_world(placement))


def camera_to_world(placement: CameraPlacement) -> Array:
    """(4, 4) from OpenCV camera axes to the world frame, the image's horizon level."""
    eye = np.array(placement.eye_m)
    forward = np.array(placement.target_m) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    transform: Array = np.eye(4)
    transform[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    transform[:3, 3] = eye
    return transform


def base_spec() -> mujoco.MjSpec:
    """A mujoco.MjSpec of the world without a task. World frame: origin on the floor, z up, x away from the robot."""
    spec = mujoco.MjSpec.from_string(ROOM)
    for name, placement in CAMERAS.items():
        axes = Rotation.from_matrix(camera_to_world(placement)[:3, :3] @ OPENCV_TO_MUJOCO)
        facing = {"pos": placement.eye_m, "quat": axes.as_quat(scalar_first=True)}
        spec.worldbody.add_camera(name=name, fovy=placement.vertical_fov_deg, **facing)
    panda.add_panda(spec, BASE_POSITION_M)
    return spec


def place_arm(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Put the arm at home with its gripper open, at rest, and command it to stay there."""
    for name, joint_rad in zip(panda.JOINT_NAMES, HOME_RAD, strict=True):
        data.joint(name).qpos = joint_rad
    for name in panda.FINGER_NAMES:
        data.joint(name).qpos = panda.FINGER_TRAVEL_M
    data.ctrl[: panda.NUM_JOINTS] = HOME_RAD
    data.ctrl[panda.GRIPPER_CTRL] = panda.FINGER_TRAVEL_M
    mujoco.mj_forward(model, data)
