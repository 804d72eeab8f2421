"""Episodes in the layout of PerAct's data set, with RLBench's field names and encodings.

The classes are stand-ins, pickled under RLBench's module names; the encodings follow rlbench/backend/utils.py.
"""

import pickle
import sys
from contextlib import contextmanager
from types import ModuleType

import cv2
import numpy as np

NEAR_M, FAR_M = 0.01, 4.5
SIDE_PX, FOCAL_PX = 64, 80.0
CAMERAS = ("front", "left_shoulder", "wrist")
DRAWER_ID, TABLE_ID = 98, 0x0153  # the second needs more than one byte
DRAWER_M = np.array([0.25, 0.05, 0.9])


class Demo:
    pass


class Observation:
    pass


@contextmanager
def rlbench_modules():
    """RLBench's modules with the stand-ins in them, while a pickle is written."""
    names = ("rlbench", "rlbench.demo", "rlbench.backend", "rlbench.backend.observation")
    modules = {name: ModuleType(name) for name in names}
    modules["rlbench.demo"].Demo, modules["rlbench.backend.observation"].Observation = Demo, Observation
    Demo.__module__, Observation.__module__ = "rlbench.demo", "rlbench.backend.observation"
    sys.modules.update(modules)
    try:
        yield
    finally:
        for name in names:
            del sys.modules[name]


def extrinsics(eye_m, target_m):
    """RLBench's camera matrix: axes x left, y up, z forward, to the world."""
    forward = (target_m - eye_m) / np.linalg.norm(target_m - eye_m)
    left = np.cross([0.0, 0.0, 1.0], forward)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([left, np.cross(forward, left), forward], axis=1)
    matrix[:3, 3] = eye_m
    return matrix


def view(matrix):
    """Depth (m) and ids of a small drawer front, a disc facing the camera, before a wall 3 m away."""
    inverse = np.linalg.inv(matrix)
    x, y, z = inverse[:3, :3] @ DRAWER_M + inverse[:3, 3]
    column, row = -FOCAL_PX * x / z + SIDE_PX / 2, -FOCAL_PX * y / z + SIDE_PX / 2
    rows, columns = np.indices((SIDE_PX, SIDE_PX))
    on_it = (rows - row) ** 2 + (columns - column) ** 2 <= 16
    return np.where(on_it, z, 3.0), np.where(on_it, DRAWER_ID, TABLE_ID), (row, column)


def rgb24(numbers, high_first):
    """24-bit numbers as RGB bytes."""
    high, middle, low = numbers >> 16 & 255, numbers >> 8 & 255, numbers & 255
    order = (high, middle, low) if high_first else (low, middle, high)
    return np.stack(order, axis=-1).astype(np.uint8)


def misc_of(matrices):
    """The `misc` of an observation."""
    intrinsics = np.array([[-FOCAL_PX, 0, SIDE_PX / 2], [0, -FOCAL_PX, SIDE_PX / 2], [0, 0, 1]])
    misc = {"variation_index": 1, "joint_poses": [np.zeros(7)]}
    for name, matrix in matrices.items():
        planes = {f"{name}_camera_near": NEAR_M, f"{name}_camera_far": FAR_M}
        misc.update({f"{name}_camera_extrinsics": matrix, f"{name}_camera_intrinsics": intrinsics, **planes})
    return misc


def write_png(path, rgb):
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.ascontiguousarray(rgb[..., ::-1]))


def write_images(folder, name, matrix, frame=0):
    depth_m, ids, _ = view(matrix)
    share = (depth_m - NEAR_M) / (FAR_M - NEAR_M)
    rgb = np.random.default_rng(3).integers(0, 255, (SIDE_PX, SIDE_PX, 3), np.uint8)
    write_png(folder / f"{name}_rgb" / f"{frame}.png", rgb)
    write_png(
        folder / f"{name}_depth" / f"{frame}.png", rgb24(np.floor(share * (2**24 - 1) + 0.5).astype(np.int64), True)
    )
    write_png(folder / f"{name}_mask" / f"{frame}.png", rgb24(ids, False))


def default_matrices():
    """Three cameras that look at the drawer from all sides."""
    eyes_m = ((1.3, 0.0, 1.5), (-0.2, 0.7, 1.6), (0.3, -0.6, 1.4))
    return {name: extrinsics(np.array(eye_m), DRAWER_M) for name, eye_m in zip(CAMERAS, eyes_m, strict=True)}


def write_episode(folder, trajectory, instruction="open the bottom drawer", matrices=None, protocol=None):
    """One episode folder, like PerAct's generator."""
    folder.mkdir(parents=True)
    matrices = default_matrices() if matrices is None else matrices
    observations = []
    for t in range(len(trajectory)):
        seen = Observation()
        seen.joint_velocities = trajectory.joint_velocities_rad_s[t]
        seen.joint_positions = (
            np.zeros(7) if trajectory.joint_positions_rad is None else trajectory.joint_positions_rad[t]
        )
        seen.joint_forces = np.zeros(7)
        seen.gripper_open = float(trajectory.gripper_open[t])
        seen.gripper_pose = np.concatenate([trajectory.positions_m[t], trajectory.quaternions_xyzw[t]])
        seen.gripper_matrix = np.eye(4)
        seen.gripper_joint_positions = np.full(2, 0.04)
        seen.gripper_touch_forces = np.zeros(6, np.float32)
        seen.task_low_dim_state = np.concatenate([[0.5], DRAWER_M, [0.0, 0.0, 0.0, 1.0]])  # a joint, then the pose
        seen.ignore_collisions = np.float64(1.0)  # a numpy scalar, as PerAct's fork records it
        seen.front_rgb = seen.front_depth = seen.front_mask = None
        seen.misc = misc_of(matrices)
        observations.append(seen)
    demo = Demo()
    demo._observations, demo.random_seed, demo.num_reset_attempts = observations, np.random.get_state(), 1
    with rlbench_modules():
        (folder / "low_dim_obs.pkl").write_bytes(pickle.dumps(demo, protocol))
    (folder / "variation_descriptions.pkl").write_bytes(pickle.dumps([instruction, f"please {instruction}"]))
    (folder / "variation_number.pkl").write_bytes(pickle.dumps(1))
    for name, matrix in matrices.items():
        write_images(folder, name, matrix)
