"""An arm by its URDF: a UR5e's, whose maker publishes Denavit-Hartenberg parameters."""

from pathlib import Path

import numpy as np
import pytest

from roboprompt_client.arms.ur_geometry import URGeometry
from roboprompt_client.arms.urdf import MAX_CHARS, UrdfGeometry
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.types import quaternions as rotations

FILE = Path(__file__).with_name("ur5e.urdf")
TEXT = FILE.read_text()
READY_RAD = np.array([0.0, -1.6, 1.6, -1.6, -1.6, 0.0])
PAN = '<origin xyz="0 0 0" rpy="0 0 3.141592653589793"/><axis xyz="0 0 1"/>'


@pytest.fixture(scope="module")
def arm():
    return UrdfGeometry(TEXT, "tool0", "base")


def test_the_hand_is_where_the_maker_s_parameters_put_it(arm):
    rng = np.random.default_rng(0)
    named = URGeometry("ur5e", np.eye(4))
    for joints in rng.uniform(arm.low_rad, arm.high_rad, (20, 6)):
        np.testing.assert_allclose(arm.hand(joints), named.hand(joints), atol=1e-9)
        np.testing.assert_allclose(arm.flange(joints)[1], named.flange(joints)[1], atol=1e-9)
        turned = UrdfGeometry(TEXT, "tool0").hand(joints)  # ROS's base_link looks the other way
        np.testing.assert_allclose(turned[:3, 3], arm.hand(joints)[:3, 3] * [-1, -1, 1], atol=1e-9)


def test_the_jacobian_is_the_derivative(arm):
    pose, jacobian = arm.flange(READY_RAD)
    for k, step in enumerate(np.eye(6) * 1e-6):
        there, _ = arm.flange(READY_RAD + step)
        turn = rotations.to_rotation_vector(rotations.from_matrix(there[:3, :3] @ pose[:3, :3].T))
        moved = np.concatenate([there[:3, 3] - pose[:3, 3], turn]) / 1e-6
        np.testing.assert_allclose(moved, jacobian[:, k], atol=1e-4)


def test_a_straight_way_ends_where_it_shall_or_is_refused(arm):
    pose = arm.hand(READY_RAD)
    rotation = rotations.from_matrix(pose[:3, :3])
    joints = arm.way(READY_RAD, pose[:3, 3] + [0.1, 0.2, -0.2], rotation)
    np.testing.assert_allclose(arm.hand(joints)[:3, 3], pose[:3, 3] + [0.1, 0.2, -0.2], atol=1e-3)
    assert arm.nearest_limit(joints).joint == 3
    with pytest.raises(MotionError, match=r"joint \d would come to|out of reach"):
        arm.way(READY_RAD, np.array([1.2, 0, 0.4]), rotation)
    with pytest.raises(MotionError, match="reports 7 joints, its geometry has 6"):
        arm.way(np.zeros(7), pose[:3, 3], rotation)


def test_joints_by_name_whatever_their_order():
    arm = UrdfGeometry.read(FILE, "tool0")
    angles = {"gripper": 1.0, **dict(reversed(list(zip(arm.names, READY_RAD, strict=True))))}
    np.testing.assert_array_equal(arm.frame(angles), arm.hand(READY_RAD))
    del angles["elbow_joint"]
    with pytest.raises(MotionError, match="joints elbow_joint are not among gripper, wrist_3_joint"):
        arm.frame(angles)


def test_what_is_kept_is_a_urdf_of_the_same_arm(arm):
    kept = UrdfGeometry(arm.urdf, "tool0", "base")
    assert kept.urdf == arm.urdf
    assert "finger" not in kept.urdf
    assert "mesh" not in kept.urdf
    np.testing.assert_array_equal(kept.hand(READY_RAD), arm.hand(READY_RAD))


def test_a_joint_without_limits_turns_on():
    arm = UrdfGeometry(TEXT.replace('elbow_joint" type="revolute', 'elbow_joint" type="continuous'), "tool0")
    assert (arm.low_rad[2], arm.high_rad[2]) == (-np.inf, np.inf)
    assert arm.nearest_limit(np.array([0, 0, 100, 0, 0, 6.2])).joint == 6


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("no", "urdf: is no XML"),
        ("<robot>\ud800</robot>", "urdf: is no XML"),
        ("<robot>" * 9, "urdf: is no XML"),
        ("<mujoco/>", "begins with <mujoco>"),
        ("<robot/>", "frame: 'tool0' is not in the URDF"),
        ("<robot><joint/></robot>", "has no child link"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><robot/>", "has a DOCTYPE"),
        (f"<robot>{' ' * MAX_CHARS}</robot>", "has 500015 characters"),
        (TEXT.replace("revolute", "floating"), "shoulder_pan_joint is 'floating'"),
        (TEXT.replace("<limit", "<mimic joint='a'/><limit"), "shoulder_pan_joint follows another"),
        (TEXT.replace("revolute", "fixed"), "'tool0' is moved by 0 joints"),
        (TEXT.replace(PAN, '<axis xyz="0 0 0"/>'), r"has the axis \[0.0, 0.0, 0.0\]"),
        (TEXT.replace(PAN, '<origin xyz="0 0 nan"/>'), "origin xyz: element .2. is nan"),
        (TEXT.replace(PAN, '<origin xyz="0 0 11"/>'), "is 11 .valid: -10 to 10 m"),
        (TEXT.replace(PAN, '<origin rpy="0 0 ${yaw}"/>'), "has the origin rpy '0 0 \\${yaw}'"),
        (TEXT.replace('upper="3', 'upper="-4'), "elbow_joint has the limits -3.14159 to -4.14159 rad"),
        (TEXT.replace(' lower="', ' low="'), "has the limit lower 'missing'"),
        (TEXT.replace('<parent link="base_link"/>', '<parent link="tool0"/>'), "is in a circle"),
        (TEXT.replace('<child link="finger"/>', '<child link="tool0"/>'), "moves 'tool0', as wrist_3-tool0 does"),
    ],
)
def test_what_is_no_arm_is_refused(text, message):
    with pytest.raises(InvalidInputError, match=message):
        UrdfGeometry(text, "tool0")


def test_a_base_that_moves_is_refused():
    with pytest.raises(InvalidInputError, match="base: 'finger' moves: shoulder_pan_joint"):
        UrdfGeometry(TEXT, "base", "finger")
    with pytest.raises(InvalidInputError, match="base: 'nowhere' is not in the URDF"):
        UrdfGeometry(TEXT, "tool0", "nowhere")


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match=r"none\.urdf"):
        UrdfGeometry.read(tmp_path / "none.urdf", "tool0")
