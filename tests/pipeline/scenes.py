"""Short ways to say objects, actions and demonstrations."""

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.workspace import Workspace
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

WORKSPACE = Workspace.rlbench()
DOWN_DEG = (180, 0, 0)


def rotated(*euler_deg):
    """A rotation from its extrinsic xyz Euler angles."""
    return Rotation.from_euler("xyz", euler_deg, degrees=True)


def pose(name, position_m, rotation=None):
    """An object; `rotation` as a yaw in degrees, as a Rotation, or unknown."""
    if isinstance(rotation, int | float):
        rotation = rotated(0, 0, rotation)
    return ObjectPose(name, np.array(position_m), None if rotation is None else rotation.as_quat())


def action(position_m, euler_deg=DOWN_DEG, gripper_open=True):
    return EndEffectorAction(np.array(position_m), rotated(*euler_deg).as_quat(), gripper_open)


def demonstration(instruction, objects, actions):
    return Demonstration(instruction, tuple(objects), tuple(actions))


def angle_deg(a_xyzw, b_xyzw):
    """The angle between two rotations."""
    return np.degrees((Rotation.from_quat(a_xyzw).inv() * Rotation.from_quat(b_xyzw)).magnitude())


def same_actions(first, second):
    """Whether two sequences of actions are equal, bit by bit."""
    return len(first) == len(second) and all(
        np.array_equal(a.position_m, b.position_m)
        and np.array_equal(a.quaternion_xyzw, b.quaternion_xyzw)
        and a.gripper_open == b.gripper_open
        for a, b in zip(first, second, strict=True)
    )


def rotations():
    """Any rotation."""
    return st.integers(0, 2**32 - 1).map(lambda seed: Rotation.random(rng=np.random.default_rng(seed)))


def positions(low=WORKSPACE.min_m, high=WORKSPACE.max_m):
    """Positions between two corners."""
    return st.tuples(*(st.floats(a, b) for a, b in zip(low, high, strict=True))).map(np.array)
