"""Recordings in which a person grasps again."""

import numpy as np
import pytest

from app.pipeline.plans import aligned_by_plan
from app.pipeline.plans.tries import without_tries

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


def test_what_as_many_do_twice_is_left():
    both = [*(picked(k) for k in range(2)), slipped(8), slipped(9)]
    assert without_tries(both) == both
