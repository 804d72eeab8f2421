"""Recordings of arms of any kind: what may be left out, and what then follows."""

import numpy as np
import pytest

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory_npz import npz_from_trajectory, trajectory_from_arrays, trajectory_from_npz

T = 21
TIMES_S = np.arange(T) / 20
WIDTHS_M = np.concatenate([np.full(10, 0.079), np.full(11, 0.031)])  # closed on a thing of 3 cm


def arrays(**changes):
    named = {
        "end_effector_positions": np.linspace([0.1, 0, 0.5], [0.3, 0.1, 0.2], T),
        "end_effector_quaternions_xyzw": np.tile([1.0, 0, 0, 0], (T, 1)),
        "gripper_open": np.arange(T) < 10,
        **changes,
    }
    return {name: array for name, array in named.items() if array is not None}


@pytest.mark.parametrize("num_joints", [1, 5, 6, 16])
def test_velocities_follow_from_positions_and_times(num_joints):
    speeds = np.linspace(0.1, 0.5, num_joints)
    recorded = trajectory_from_arrays(arrays(joint_positions=np.outer(TIMES_S, speeds), timestamps=TIMES_S))
    assert recorded.num_joints == num_joints
    np.testing.assert_allclose(recorded.joint_velocities_rad_s, np.tile(speeds, (T, 1)))


def test_without_joints_there_are_none():
    recorded = trajectory_from_arrays(arrays())
    assert (recorded.num_joints, len(recorded)) == (0, T)
    assert trajectory_from_npz(npz_from_trajectory(recorded)).num_joints == 0


def test_positions_without_times_say_what_is_missing():
    with pytest.raises(InvalidInputError, match="no timestamps") as caught:
        trajectory_from_arrays(arrays(joint_positions=np.zeros((T, 6))))
    assert caught.value.field == "trajectory.joint_velocities"
    with pytest.raises(InvalidInputError, match="do not increase"):
        trajectory_from_arrays(arrays(joint_positions=np.zeros((T, 6)), timestamps=np.zeros(T)))


def test_seventeen_joints_are_no_arm():
    with pytest.raises(InvalidInputError, match="has 17 joints"):
        trajectory_from_arrays(arrays(joint_velocities=np.zeros((T, 17))))


def test_measured_fingers_are_open_above_the_middle_or_above_what_is_said():
    recorded = trajectory_from_arrays(arrays(gripper_open=None, gripper_width=WIDTHS_M))
    np.testing.assert_array_equal(recorded.gripper_open, np.arange(T) < 10)
    assert recorded.with_gripper_open_above(0.02).gripper_open.all()
    assert not recorded.with_gripper_open_above(0.08).gripper_open.any()
    assert recorded.with_gripper_open_above(None) is recorded
    both = trajectory_from_npz(npz_from_trajectory(recorded))
    np.testing.assert_array_equal(both.gripper_width_m, WIDTHS_M)


def test_fingers_that_do_not_move_do_not_say_whether_they_are_open():
    still = arrays(gripper_open=None, gripper_width=np.full(T, 0.04))
    with pytest.raises(InvalidInputError, match=r"stays at 0\.0400") as caught:
        trajectory_from_arrays(still)
    assert "gripper_open" in caught.value.valid
    assert trajectory_from_arrays({**still, "gripper_open": np.ones(T)}).gripper_open.all()


@pytest.mark.parametrize("widths", [np.full(T, 80.0), np.full(T - 1, 0.04), np.full((T, 2), 0.04), ["wide"] * T])
def test_widths_are_metres(widths):
    with pytest.raises(InvalidInputError) as caught:
        trajectory_from_arrays(arrays(gripper_width=widths))
    assert caught.value.field == "trajectory.gripper_width"
