import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.planner import Kinematics
from app.sim.world import base_spec

BASE_M = np.array([0.1, -0.2, 0.3])
# Franka Robotics, Robot and interface specifications: a_i m, d_i m, alpha_i rad of the modified DH convention
PUBLISHED_DH = [
    (0, 0.333, 0),
    (0, 0, -np.pi / 2),
    (0, 0.316, np.pi / 2),
    (0.0825, 0, np.pi / 2),
    (-0.0825, 0.384, -np.pi / 2),
    (0, 0, np.pi / 2),
    (0.088, 0, np.pi / 2),
]
FLANGE_M, HAND_TURN_RAD, TOOL_M = 0.107, -np.pi / 4, 0.1034


def transform(rotation, translation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), translation
    return matrix


def published_tool_pose(joints_rad):
    pose = transform(Rotation.identity(), BASE_M)
    for (a_m, d_m, alpha_rad), joint_rad in zip(PUBLISHED_DH, joints_rad, strict=True):
        pose = pose @ transform(Rotation.from_euler("x", alpha_rad), [a_m, 0, 0])
        pose = pose @ transform(Rotation.from_euler("z", joint_rad), [0, 0, d_m])
    return pose @ transform(Rotation.from_euler("z", HAND_TURN_RAD), [0, 0, FLANGE_M + TOOL_M])


def test_forward_kinematics_are_the_published_ones():
    random = np.random.default_rng(0)
    kinematics = Kinematics(BASE_M)
    for joints_rad in random.uniform(panda.JOINT_MIN_RAD, panda.JOINT_MAX_RAD, (50, 7)):
        pose = kinematics.forward(joints_rad)
        expected = published_tool_pose(joints_rad)
        np.testing.assert_allclose(pose.position_m, expected[:3, 3], atol=1e-9)
        np.testing.assert_allclose(pose.rotation.as_matrix(), expected[:3, :3], atol=1e-9)


def test_compiled_limits_are_in_radians():
    model = base_spec().compile()
    for name, low, high in zip(panda.JOINT_NAMES, panda.JOINT_MIN_RAD, panda.JOINT_MAX_RAD, strict=True):
        assert model.joint(name).range.tolist() == pytest.approx([low, high])


def test_arm_weighs_what_was_identified():
    model = base_spec().compile()
    masses = [model.body(f"link{i}").mass[0] for i in range(1, 8)]
    assert masses == pytest.approx(panda.LINK_MASS_KG)


def test_fingers_close_together():
    model = base_spec().compile()
    data = mujoco.MjData(model)
    for name in panda.FINGER_NAMES:
        data.joint(name).qpos = panda.FINGER_TRAVEL_M
    data.ctrl[: panda.NUM_JOINTS] = data.qpos[: panda.NUM_JOINTS] = panda.READY_RAD
    mujoco.mj_step(model, data, nstep=300)
    left, right = (float(data.joint(name).qpos[0]) for name in panda.FINGER_NAMES)
    assert abs(left - right) < 1e-3
    assert abs(left) < 1e-3
