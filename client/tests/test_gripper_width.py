from itertools import pairwise

import numpy as np
import pytest

from roboprompt_client.types.gripper import open_by_width

OPEN_M, WIDE_M, NARROW_M = 0.08, 0.067, 0.043  # a can of 6.7 cm, a box of 4.3 cm


def recorded(*widths_m, moves=6, rests=20):
    """The fingers rest at each width, and go from one to the next in a few frames."""
    parts = [np.full(rests, widths_m[0])]
    for start_m, end_m in pairwise(widths_m):
        parts += [np.linspace(start_m, end_m, moves), np.full(rests, end_m)]
    return np.concatenate(parts)


def states(opened):
    """The states one after the other."""
    return opened[np.flatnonzero(np.diff(opened, prepend=~opened[0]))].tolist()


@pytest.mark.parametrize("low_m", [0.0, NARROW_M, WIDE_M])
def test_one_grasp_begins_and_ends_in_the_middle_of_the_fingers_way(low_m):
    widths_m = recorded(OPEN_M, low_m, OPEN_M)
    np.testing.assert_array_equal(open_by_width(widths_m), widths_m > (OPEN_M + low_m) / 2)


@pytest.mark.parametrize("order", [(WIDE_M, NARROW_M), (NARROW_M, WIDE_M)])
def test_a_grasp_of_something_wide_counts_beside_one_of_something_narrow(order):
    first_m, second_m = order
    widths_m = recorded(OPEN_M, first_m, OPEN_M, second_m, OPEN_M)
    assert states(open_by_width(widths_m)) == [True, False, True, False, True]


def test_fingers_that_open_partly_have_let_go():
    assert states(open_by_width(recorded(OPEN_M, NARROW_M, 0.058, NARROW_M, OPEN_M))) == [
        True,
        False,
        True,
        False,
        True,
    ]


@pytest.mark.parametrize("seed", range(20))
def test_fingers_that_tremble_or_slip_do_not_switch(seed):
    random = np.random.default_rng(seed)
    widths_m = recorded(OPEN_M, NARROW_M, NARROW_M - 0.002, OPEN_M) + random.normal(0, 0.0004, 98)
    assert states(open_by_width(widths_m)) == [True, False, True]


def test_fingers_that_give_way_to_what_they_hold_have_not_let_go():
    assert states(open_by_width(recorded(OPEN_M, 0.06, 0.066, 0.06, OPEN_M))) == [True, False, True]


@pytest.mark.parametrize("first", [True, False])
def test_a_recording_may_begin_and_end_in_either_state(first):
    widths_m = recorded(OPEN_M, NARROW_M) if first else recorded(NARROW_M, OPEN_M)
    assert states(open_by_width(widths_m)) == [first, not first]
    assert states(open_by_width(np.array([OPEN_M, NARROW_M][:: 1 if first else -1]))) == [first, not first]
