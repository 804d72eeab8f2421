"""Recordings in which a person grasps again."""

from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.keyframes import Motion
from app.pipeline.plans import aligned_by_plan
from app.pipeline.plans.tries import without_tries
from roboprompt_client.types.trajectory import Trajectory

from .taught import picked, slipped


@pytest.mark.parametrize("slips", [1, 2, 3])
def test_a_second_try_is_no_plan_of_its_own_where_most_have_one(slips):
    recordings = without_tries([*(picked(k) for k in range(4)), *(slipped(k) for k in range(8, 8 + slips))])
    shown = aligned_by_plan(recordings)
    assert len({(item.plan, len(item.actions)) for item in shown}) == 1


def test_the_hand_goes_on_from_its_last_grasp():
    *_, once = without_tries([*(picked(k) for k in range(2)), slipped(9)])
    twice = slipped(9).motion
    closes, releases = once.motion.switches
    assert (closes.frame, releases.frame) == pytest.approx((twice.switches[2].frame, twice.switches[3].frame), abs=1)
    np.testing.assert_array_equal(once.motion.times_s, twice.times_s)
    np.testing.assert_array_equal(once.motion.trajectory.positions_m, twice.trajectory.positions_m)


def test_of_several_tries_the_last_counts():
    *others, once = without_tries([*(picked(k) for k in range(2)), slipped(9, times=3)])
    assert once.signature == others[0].signature
    assert once.motion.switches[0].frame == pytest.approx(slipped(9, times=3).motion.switches[6].frame, abs=1)


def squeezed(times):
    """The cube is grasped so often, and let go in its place."""
    item = slipped(9, times=times)
    trajectory, last = item.motion.trajectory, item.motion.gripper_changes[2 * times]
    kept = slice(0, last)  # open since the last time
    names = ("joint_velocities_rad_s", "positions_m", "quaternions_xyzw", "gripper_open")
    cut = Trajectory(*(getattr(trajectory, name)[kept] for name in names))
    return replace(item, motion=Motion.of(cut, 20))


def test_what_is_squeezed_twice_was_not_missed():
    recordings = [*(squeezed(1) for _ in range(3)), squeezed(2)]
    assert [len(item.signature) for item in recordings] == [4, 4, 4, 6]
    assert without_tries(recordings) == recordings


def test_fingers_that_flicker_are_no_second_try():
    recordings = [*(picked(k) for k in range(4)), slipped(9, again_s=0.5)]
    assert len(recordings[-1].signature) > len(recordings[0].signature)
    assert without_tries(recordings) == recordings


def test_what_as_many_do_twice_is_left():
    both = [*(picked(k) for k in range(2)), slipped(8), slipped(9)]
    assert without_tries(both) == both


def test_a_hand_that_moves_in_between_does_something_else():
    recordings = [*(picked(k) for k in range(4)), slipped(9, again_s=4.0)]
    assert without_tries(recordings) == recordings


def test_other_recordings_are_left():
    recordings = [picked(k) for k in range(3)]
    assert without_tries(recordings) == recordings
