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
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.geometry import rigid
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
from roboprompt_client.cameras.board import CharucoBoard
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
# A camera beside the fingers that looks along them
WRIST = rigid((0.08, 0.0, -0.10), Rotation.from_euler("zy", [90, -8], degrees=True).as_quat())
BOARD = CharucoBoard(5, 7, 0.03, 0.022)
BOARD_TO_WORLD = rigid((0.12, -0.10, TABLE_TOP_M), (0, 0, 0, 1))
FINER = 4  # than a pixel: what is drawn is averaged, as a sensor does
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
        self.board = False  # whether one lies on the table
        self._seen = {}
        self._flicker = self._random.integers(0, 3, (HEIGHT_PX + 64, WIDTH_PX + 64, 3), dtype=np.uint8)

    def go(self, position_m, euler_deg):
        """The person guides the hand there."""
        self.perform([Move(ToolPose(np.array(position_m), Rotation.from_euler("xyz", euler_deg, degrees=True)), True)])

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
        pose = camera_to_world(PLACES[name]) if name in PLACES else self.hand() @ WRIST
        pose[:3, 3] += along_x_m * pose[:3, 0]
        return Camera(name, FOCAL_PX, FOCAL_PX, *center_px, pose)

    def hand(self):
        """(4, 4) where it is."""
        hand = self.robot.hand
        return rigid(hand.position_m, hand.rotation.as_quat())

    def shoot(self, name, along_x_m=0.0):
        """Color and depth (mm) with noise, the depth as seen by a camera so far beside it.

        Rays are cast when something has moved; from then on only the color flickers.
        """
        state = self.task.data.qpos.round(4).tobytes()
        if self._seen.get(name, (b"",))[0] != state:
            with self._moving:
                cast = cache(lambda x_m: self._caster.frame(self.task.data, self.camera(name, x_m)))
                sides = [cast(0.0), cast(along_x_m)]
            if self.board:
                sides = [replace(side, rgb=_with_board(side)) for side in sides]
            color, depth = (as_a_camera_sees_it(side, self._random) for side in sides)
            self._seen[name] = (state, color.rgb, np.rint(depth.depth_m * 1000).astype(np.uint16))
        _, rgb, units = self._seen[name]
        row, column = self._random.integers(0, 64, 2)
        return cv2.add(rgb, self._flicker[row : row + HEIGHT_PX, column : column + WIDTH_PX]), units


def _with_board(frame):
    """The colors with a ChArUco board drawn in that lies on the table."""
    texture = cv2.resize(BOARD.picture(), None, fx=1 / 3, fy=1 / 3, interpolation=cv2.INTER_AREA)
    rim_m, m_of_px = BOARD.square_m / 2, (BOARD.size_m[0] + BOARD.square_m) / texture.shape[1]
    left, top = m_of_px / 2 - rim_m, BOARD.size_m[1] + rim_m - m_of_px / 2
    to_board = np.array([[m_of_px, 0, left], [0, -m_of_px, top], [0, 0, 1]])
    seen = np.linalg.inv(frame.camera.camera_to_world) @ BOARD_TO_WORLD
    matrix = np.array([[FOCAL_PX, 0, frame.camera.cx_px], [0, FOCAL_PX, frame.camera.cy_px], [0, 0, 1]])
    finer = np.array([[FINER, 0, (FINER - 1) / 2], [0, FINER, (FINER - 1) / 2], [0, 0, 1]])
    homography = finer @ matrix @ seen[:3, [0, 1, 3]] @ to_board
    size_px = (WIDTH_PX * FINER, HEIGHT_PX * FINER)
    drawn, covered = (
        cv2.resize(cv2.warpPerspective(image, homography, size_px), (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
        for image in (texture, np.full_like(texture, 255))
    )
    share = covered[..., None] / 255.0
    return (frame.rgb * (1 - share) + drawn[..., None]).clip(0, 255).astype(np.uint8)


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
