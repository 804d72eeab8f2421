"""Of several replies one is the answer, as it was said; they are never mixed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.pipeline.errors import ReplyParseError
from app.pipeline.reply import SAME_WAY_M, consensus
from roboprompt_client.types.poses import EndEffectorAction


def action(x_m, yaw_deg=0.0, is_open=True, y_m=0.0):
    rotation = Rotation.from_euler("z", yaw_deg, degrees=True)
    return EndEffectorAction(np.array([x_m, y_m, 1.0]), rotation.as_quat(), is_open)


def round_the_peg(y_m):
    return [action(0.0), action(0.2, y_m=y_m), action(0.4)]


def test_of_two_ways_round_a_peg_one_is_gone():
    """Their median goes through it."""
    samples = [round_the_peg(y_m) for y_m in (0.1, -0.1, 0.11, -0.1, 0.105)]
    agreed = consensus(samples)
    assert (agreed.chosen, agreed.alike) == (4, (0, 2, 4))


def test_of_equally_many_those_that_agree_more_closely_count():
    agreed = consensus([round_the_peg(y_m) for y_m in (0.1, -0.1, 0.13, -0.11)])
    assert agreed.alike == (1, 3)


def test_samples_of_another_length_and_invalid_ones_are_left_out():
    agreed = consensus([[action(0.9)] * 3, [action(0.1)] * 2, None, [action(0.11)] * 2, [action(0.3)] * 2])
    assert agreed.alike == (1, 3)


@pytest.mark.parametrize(
    "samples",
    [
        [[action(0.1)], [action(0.1)] * 2],
        [[action(0.1)], None],
        [None, None],
        [[action(0.1)], [action(0.1)], [action(0.1)] * 2, None],
    ],
)
def test_half_of_the_samples_is_not_enough(samples):
    with pytest.raises(ReplyParseError, match="no more than half"):
        consensus(samples)


def test_a_turn_is_another_way_and_half_a_turn_is_counted_once_round():
    agreed = consensus([[action(0.0, yaw_deg)] for yaw_deg in (170.0, -170.0, 90.0)])
    assert agreed.alike == (0, 1)


def test_a_gripper_that_does_otherwise_is_another_way():
    agreed = consensus([[action(0.1, is_open=is_open)] for is_open in (True, False, False)])
    assert (agreed.chosen, agreed.alike) == (1, (1, 2))


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-180, 180)), min_size=1, max_size=8))
def test_no_reply_that_is_left_out_is_near_to_one_that_agrees(said):
    agreed = consensus([[action(x_m, yaw_deg)] for x_m, yaw_deg in said])
    assert agreed.chosen in agreed.alike
    for k, (x_m, _) in enumerate(said):
        if k not in agreed.alike:
            near = [j for j in agreed.alike if abs(said[j][0] - x_m) < SAME_WAY_M and said[j][1] == said[k][1]]
            assert not near
