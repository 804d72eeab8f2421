"""A lab that is simulated: a Panda, a mug on a table, and cameras with the noise of a D435.

Each camera is a RealSense of librealsense's own software device where pyrealsense2 is installed; otherwise its frames
go through a folder. All of it lives in this process, as a lab goes on between two commands.
"""

import importlib.util
import json
import os
import sys
import threading
import time
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.moves import Move, ToolPose, pick, tool_down
from app.sim.rendering import RayCaster
from app.sim.robot import SimulatedPanda
from app.sim.scene import about_z
from app.sim.tasks.base import SimTask
from app.sim.world import (
    BASE_POSITION_M,
    HEIGHT_PX,
    TABLE_TOP_M,
    WIDTH_PX,
    CameraPlacement,
    camera_to_world,
)
from roboprompt_client.arms.driver import ArmState
from roboprompt_client.cameras.files import FrameFolder
from roboprompt_client.types.camera import Camera
from synthetic.camera_noise import as_a_camera_sees_it

FOCAL_PX = 600.0
RATE_HZ = 8
HAS_REALSENSE = importlib.util.find_spec("pyrealsense2") is not None
PLACES = {
    "front": CameraPlacement((0.75, 0.35, 1.35), (0.18, 0.0, 0.80), 0.0),
    "left": CameraPlacement((0.25, 0.70, 1.30), (0.18, 0.0, 0.80), 0.0),
    "right": CameraPlacement((0.45, -0.65, 1.30), (0.18, 0.0, 0.80), 0.0),
}
GRASP_M = 0.055  # above the table, where the fingers hold the mug's wall
SPEED = 2.0  # simulated seconds in a second
HEIGHT_M, RADIUS_M, WALL_M = 0.080, 0.033, 0.004


class MugOnTable(SimTask):
    """A mug with a handle that can be lifted; it stands where `put` says."""

    name = "walk"
    object_names = ("mug",)
    instruction = "lift the mug"

    def build(self, random):
        mug = self.add_part("mug", (0.15, 0.0, TABLE_TOP_M), about_z(0.0), free=True)
        mug.wall("blue", bottom_m=WALL_M, top_m=HEIGHT_M, bottom_radius_m=RADIUS_M, thickness_m=WALL_M, mass_kg=0.08)
        mug.cylinder(RADIUS_M, WALL_M / 2, "white", at_m=(0, 0, WALL_M / 2), mass_kg=0.03)
        for z_m in (0.022, 0.062):
            mug.box((0.012, 0.005, 0.005), "red", at_m=(0.044, 0, z_m), mass_kg=0.004)
        mug.box((0.005, 0.005, 0.025), "red", at_m=(0.058, 0, 0.042), mass_kg=0.004)

    def put(self, x_m, y_m, yaw_rad):
        """As a person does between two demonstrations: the arm is at home, too."""
        self._reset()
        address = self.model.joint(self.model.body("mug").jntadr[0]).qposadr[0]
        x, y, z, w = about_z(yaw_rad).as_quat()
        self.data.qpos[address : address + 7] = [x_m, y_m, TABLE_TOP_M + 0.001, w, x, y, z]
        self.data.qvel[:] = 0

    def expert(self):
        return pick(self.position_m("mug") + np.array([0, 0, GRASP_M]), tool_down(self.yaw_rad("mug")), 0.15)

    def succeeded(self):
        return bool(self.position_m("mug")[2] > TABLE_TOP_M + 0.08)


class Lab:
    """The scene, the arm in it, and what its cameras see."""

    def __init__(self):
        self.task = MugOnTable(0)
        self.robot = SimulatedPanda(self.task, cameras=())
        self.robot.after_step.append(self._pace)
        self._began = (time.monotonic(), self.task.data.time)
        self._moving = threading.Lock()
        self._caster = RayCaster(self.task.model)
        self._random = np.random.default_rng(0)
        self._seen = {}
        self._flicker = self._random.integers(0, 3, (HEIGHT_PX + 64, WIDTH_PX + 64, 3), dtype=np.uint8)

    def put(self, x_m, y_m, yaw_deg):
        with self._moving:
            self.task.put(x_m, y_m, np.radians(yaw_deg))
            self.robot._target_rad = self.task.data.ctrl[: panda.NUM_JOINTS].copy()
            self.robot.hold(0.3)

    def perform(self, moves):
        with self._moving:
            self._began = (time.monotonic(), self.task.data.time)
            self.robot.perform(moves)

    def _pace(self):
        wall_s, simulated_s = self._began
        if (ahead_s := (self.task.data.time - simulated_s) / SPEED - (time.monotonic() - wall_s)) > 0.01:
            time.sleep(ahead_s)
        elif ahead_s < 0:  # what a busy computer missed is not made up for: no arm leaps
            self._began = (time.monotonic(), self.task.data.time)

    def camera(self, name, along_x_m=0.0):
        """Its true calibration, or that of one which is so far beside it."""
        center_px = ((WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2)
        pose = camera_to_world(PLACES[name])
        pose[:3, 3] += along_x_m * pose[:3, 0]
        return Camera(name, FOCAL_PX, FOCAL_PX, *center_px, pose)

    def shoot(self, name, along_x_m=0.0):
        """Color and depth (mm) with noise, the depth as seen by a camera so far beside it.

        Rays are cast when something has moved; from then on only the color flickers.
        """
        state = self.task.data.qpos.round(4).tobytes()
        if self._seen.get(name, (b"",))[0] != state:
            with self._moving:
                cast = cache(lambda x_m: self._caster.frame(self.task.data, self.camera(name, x_m)))
                sides = [cast(0.0), cast(along_x_m)]
            color, depth = (as_a_camera_sees_it(side, self._random) for side in sides)
            self._seen[name] = (state, color.rgb, np.rint(depth.depth_m * 1000).astype(np.uint16))
        _, rgb, units = self._seen[name]
        row, column = self._random.integers(0, 64, 2)
        return cv2.add(rgb, self._flicker[row : row + HEIGHT_PX, column : column + WIDTH_PX]), units


LAB = Lab()


class SimulatedArm:
    """The driver of the lab's arm: poses in its base frame."""

    name, proven = "a simulated Panda", "MuJoCo"

    def state(self):
        data, hand = LAB.task.data, LAB.robot.hand
        joints = [data.joint(name) for name in panda.JOINT_NAMES]
        fingers_m = [float(data.joint(name).qpos[0]) for name in panda.FINGER_NAMES]
        return ArmState(
            hand.position_m - BASE_POSITION_M,
            hand.rotation.as_quat(),
            np.array([joint.qpos[0] for joint in joints]),
            np.array([joint.qvel[0] for joint in joints]),
            sum(fingers_m),
        )

    def check(self, position_m, quaternion_xyzw):
        """What is out of reach, `start` refuses before it moves."""

    def start(self, position_m, quaternion_xyzw):
        pose = ToolPose(position_m + BASE_POSITION_M, Rotation.from_quat(quaternion_xyzw))
        LAB.perform([Move(pose, LAB.robot.gripper_commanded_open)])

    def finished(self):
        return True

    def set_gripper(self, *, is_open):
        with LAB._moving:
            LAB.robot._set_gripper(is_open=is_open)

    def halt(self):
        if LAB._moving.acquire(timeout=0.1):
            LAB.robot.stop()
            LAB._moving.release()

    def recover(self):
        """Nothing to acknowledge."""

    def close(self):
        """Nothing to leave."""


def arm():
    return SimulatedArm()


def camera(name, folder):
    """The lab's camera of this name behind a driver of the client."""
    return _realsense(name) if HAS_REALSENSE else FolderCamera(name, Path(folder))


def _realsense(name):
    sys.path.insert(0, str(Path(__file__).parents[2] / "client/tests/realsense"))
    from software import BASELINE_M, SoftwareRealSense

    from roboprompt_client.cameras.realsense import RealSense

    class Owned(RealSense):
        def close(self):
            super().close()
            software.close()

    LAB.shoot(name, -BASELINE_M)  # casting rays takes longer than a camera's driver waits
    software = SoftwareRealSense(lambda: LAB.shoot(name, -BASELINE_M), fx_px=FOCAL_PX, rate_hz=20)
    return Owned(device=software.device)


class FolderCamera(FrameFolder):
    """A thread writes frames as a program beside the robot's does; the driver reads them."""

    def __init__(self, name, folder):
        folder.mkdir(parents=True, exist_ok=True)
        camera = LAB.camera(name)
        k = {"fx": camera.fx_px, "fy": camera.fy_px, "cx": camera.cx_px, "cy": camera.cy_px}
        document = {"intrinsics": {**k, "width": WIDTH_PX, "height": HEIGHT_PX}, "depth_scale": 0.001}
        (folder / "camera.json").write_text(json.dumps(document))
        super().__init__(str(folder))
        self._name, self._ended = name, threading.Event()
        self._writer = threading.Thread(target=self._write, args=(folder,), daemon=True)
        self._writer.start()

    def _write(self, folder):
        while not self._ended.wait(1 / RATE_HZ):
            taken_ns = time.time_ns()
            rgb, units = LAB.shoot(self._name)
            stem = folder / f"{taken_ns}"
            cv2.imwrite(f"{stem}_depth.png", units)
            cv2.imwrite(f"{stem}.part.png", rgb[..., ::-1])
            os.utime(f"{stem}.part.png", ns=(taken_ns, taken_ns))
            Path(f"{stem}.part.png").rename(f"{stem}_color.png")
            for old in sorted(folder.glob("*_*.png"))[:-8]:
                old.unlink(missing_ok=True)

    def close(self):
        self._ended.set()
        self._writer.join()
