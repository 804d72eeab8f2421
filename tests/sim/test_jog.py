"""The arm under a person's keys."""

import numpy as np
import pytest

from app.pipeline.keyframes import KeyframeRule, Motion, find_keyframes
from app.sim.jog import DONE, GIVE_UP, GRIPPER, JoggedPanda, drive
from app.sim.sampler import TrajectorySampler
from app.sim.tasks import make_task
from app.sim.world import TABLE_TOP_M

NEAR_M = 0.004
TAPS_M, TAP_TICKS = 0.04, 15  # near the goal the person taps, three times a second
AXES = ("ws", "ad", "rf")
PATIENCE = 3000  # ticks


@pytest.fixture
def arm():
    return JoggedPanda(make_task("push_button", 0))


def towards(arm, goals):
    """The keys of a patient person, who brings the hand to one goal after the other, and closes the gripper first."""
    left, ticks = list(goals), iter(range(PATIENCE))
    first = [GRIPPER]

    def pressed():
        tick = next(ticks)
        if first:
            return first.pop()
        away_m = left[0] - arm.hand.position_m
        if np.abs(away_m).max() < NEAR_M:
            left.pop(0)
            return "" if left else DONE
        if np.abs(away_m).max() < TAPS_M and tick % TAP_TICKS:
            return ""
        return "".join(keys[int(value < 0)] for keys, value in zip(AXES, away_m, strict=True) if abs(value) >= NEAR_M)

    return pressed


def test_a_button_is_pushed_by_hand(arm):
    """And what was recorded is a demonstration: within millimetres of the button at one of few keyframes."""
    recorders = []

    def begin():
        recorders.append(TrajectorySampler(arm))

    top_m = arm.task.position_m("red button")
    goals = [top_m + np.array([0, 0, height_m]) for height_m in (0.08, -0.006, 0.08)]
    assert drive(arm, towards(arm, goals), begin, lambda: None)
    assert arm.task.succeeded()
    trajectory = recorders[0].trajectory("measured")
    places_m = [
        trajectory.positions_m[keyframe.frame] for keyframe in find_keyframes(Motion.of(trajectory), KeyframeRule())
    ]
    assert 3 <= len(places_m) <= 8
    assert min(float(np.linalg.norm(place_m - goals[1])) for place_m in places_m) < 0.01


def test_a_key_that_is_pressed_once_moves_the_hand_a_little_and_it_rests(arm):
    before = arm.hand.position_m
    keys = iter(["w", *[""] * 50, GIVE_UP])
    assert not drive(arm, lambda: next(keys), lambda: None, lambda: None)
    moved_m = arm.hand.position_m - before
    assert 0.002 < moved_m[0] < 0.006
    assert np.abs(moved_m[1:]).max() < 0.001
    assert np.abs(arm.task.data.qvel[:7]).max() < 0.02


def test_q_turns_the_hand_to_the_left(arm):
    before = arm.hand.rotation
    for _ in range(50):
        arm.tick(np.array([0, 0, 0, 0, 0, 1.0]))
    turned = (arm.hand.rotation * before.inv()).as_rotvec()
    assert 0.4 < turned[2] < 0.8
    assert np.abs(turned[:2]).max() < 0.02


def test_against_the_table_and_at_the_end_of_its_reach_it_stays_where_it_is(arm):
    def go(direction, ticks):
        for _ in range(ticks):
            arm.tick(np.array([*direction, 0, 0, 0]))
        return arm.hand.position_m

    height_m = go([0, 0, -1.0], 400)[2]
    assert TABLE_TOP_M - 0.01 < height_m < TABLE_TOP_M + 0.01
    assert go([0, 0, 1.0], 100)[2] > height_m + 0.1
    far_m = go([1.0, 0, 0], 500)[0]
    assert 0.4 < far_m < 0.6
    assert go([-1.0, 0, 0], 100)[0] < far_m - 0.1


def test_what_touches_no_key_is_no_recording(arm):
    begun = []
    keys = iter(["", "?", DONE])
    assert drive(arm, lambda: next(keys), lambda: begun.append(1), lambda: None)
    assert begun == []
