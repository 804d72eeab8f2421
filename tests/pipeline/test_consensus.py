import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.pipeline.errors import ReplyParseError
from app.pipeline.reply import consensus, median_action
from roboprompt_client.trajectory import EndEffectorAction


def action(x_m, yaw_deg=0.0, is_open=True):
    rotation = Rotation.from_euler("z", yaw_deg, degrees=True)
    return EndEffectorAction(np.array([x_m, 0.0, 1.0]), rotation.as_quat(), is_open)


def test_an_outlier_does_not_move_the_median():
    agreed = consensus([[action(0.1)], [action(0.11)], [action(0.9)]])
    assert agreed.actions[0].position_m.tolist() == [0.11, 0.0, 1.0]
    assert agreed.used == (0, 1, 2)


def test_samples_of_another_length_and_invalid_ones_are_left_out():
    agreed = consensus([[action(0.9)] * 3, [action(0.1)] * 2, None, [action(0.2)] * 2, [action(0.3)] * 2])
    assert agreed.used == (1, 3, 4)
    assert [item.position_m[0] for item in agreed.actions] == [0.2, 0.2]


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


def test_rotations_are_averaged_across_the_half_turn():
    turned = median_action([action(0.0, 170.0), action(0.0, -170.0), action(0.0, 180.0)])
    gap = Rotation.from_quat(turned.quaternion_xyzw).inv() * Rotation.from_euler("z", 180, degrees=True)
    assert gap.magnitude() < 1e-6


@pytest.mark.parametrize(("states", "expected"), [("110", True), ("100", False), ("10", True), ("01", False)])
def test_gripper_does_what_most_say_and_the_first_breaks_a_tie(states, expected):
    assert median_action([action(0.0, is_open=state == "1") for state in states]).gripper_open is expected


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-40, 40)), min_size=1, max_size=8))
def test_median_lies_among_what_was_said(said):
    merged = median_action([action(x_m, yaw_deg) for x_m, yaw_deg in said])
    places, yaws = zip(*said, strict=True)
    assert min(places) <= merged.position_m[0] <= max(places)
    yaw_deg = math.degrees(2 * math.atan2(merged.quaternion_xyzw[2], merged.quaternion_xyzw[3]))
    assert min(yaws) - 1e-6 <= yaw_deg <= max(yaws) + 1e-6


@given(st.permutations([0.1, 0.2, 0.4, 0.7, 0.8]))
def test_order_of_the_samples_does_not_matter(places):
    assert median_action([action(x_m) for x_m in places]).position_m[0] == 0.4
