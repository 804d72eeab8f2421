"""The geometry of a Franka arm, and what is refused before it moves."""

import numpy as np
import pytest

from roboprompt_client import quaternions as rotations
from roboprompt_client.arms.panda import LIMITS_RAD, PandaGeometry, flange
from roboprompt_client.errors import MotionError

READY_RAD = np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
DOWN = np.array([1.0, 0, 0, 0])


def test_the_ready_pose():
    """libfranka's examples start there; the flange is 0.3069 m ahead and 0.5903 m up."""
    frame, _ = flange(READY_RAD)
    np.testing.assert_allclose(frame[:3, 3], [0.3069, 0, 0.5903], atol=1e-4)
    np.testing.assert_allclose(frame[:3, 2], [0, 0, -1], atol=1e-9)


def test_the_jacobian_is_the_derivative():
    joints = np.random.default_rng(0).uniform(*map(np.array, LIMITS_RAD["panda"]))
    frame, jacobian = flange(joints)
    for k in range(7):
        step = np.eye(7)[k] * 1e-6
        there, _ = flange(joints + step)
        np.testing.assert_allclose((there[:3, 3] - frame[:3, 3]) / 1e-6, jacobian[:3, k], atol=1e-5)
        turn = rotations.to_rotation_vector(rotations.from_matrix(there[:3, :3] @ frame[:3, :3].T))
        np.testing.assert_allclose(turn / 1e-6, jacobian[3:, k], atol=1e-4)


def test_a_reachable_pose_is_reached():
    tip = np.eye(4)
    tip[2, 3] = 0.1034
    joints = PandaGeometry("fr3", tip).way(READY_RAD, np.array([0.45, 0.15, 0.2]), DOWN)
    frame, _ = flange(joints)
    np.testing.assert_allclose((frame @ tip)[:3, 3], [0.45, 0.15, 0.2], atol=1e-3)


@pytest.mark.parametrize(
    ("position_m", "message"),
    [
        ((1.2, 0, 0.4), "out of reach: 1.2"),
        ((-0.5, 0.0, 0.3), r"joint \d would come to|out of reach"),
        ((0.05, 0.0, 0.1), r"joint \d would come to|out of reach"),
    ],
)
def test_what_is_out_of_reach_is_refused_before_it_moves(position_m, message):
    with pytest.raises(MotionError, match=message):
        PandaGeometry("fr3", np.eye(4)).way(READY_RAD, np.array(position_m), DOWN)


def test_a_joint_s_limit_is_named():
    turned = rotations.product(rotations.about_z(2.5), DOWN)
    with pytest.raises(MotionError, match=r"joint 7 would come to .* after \d+ % of the way"):
        PandaGeometry("fr3", np.eye(4)).way(READY_RAD, flange(READY_RAD)[0][:3, 3], turned)
