"""A robot that goes where a moving object will be: by two looks, or not at all."""

import numpy as np
import pytest
from test_look_again import Service

from roboprompt_client.answers import PredictedActions
from roboprompt_client.errors import InvalidInputError, ObjectLostError, UnsafeActionError
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.runs.look_again import Leading
from roboprompt_client.runs.loop import run_task
from roboprompt_client.runs.reanchoring import ActionAnchor
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

DOWN = np.array([1.0, 0, 0, 0])
CUBE_M = np.array([0.1, 0.0, 0.8])
UP = np.array([0.0, 0.0, 1.0])
ALONG_Y = np.array([0.0, 1.0, 0.0])
LEAD_S, ACTION_S, ANSWER_S = 1.5, 2.0, 1.0
PICK = [(0.1, True), (0.0, False), (0.1, False)]  # heights above the cube, and whether the gripper is open


class Belt:
    """An arm beside a cube that moves while the arm moves and while the service writes; its own clock."""

    def __init__(self, velocity_m_s, sinks_after_s=np.inf):
        self.now_s, self.done, self.stopped = 0.0, [], 0
        self._velocity_m_s, self._sinks_after_s = np.array(velocity_m_s), sinks_after_s

    def cube_m(self):
        sunk_m = 0.02 if self.now_s > self._sinks_after_s else 0.0
        return CUBE_M + self.now_s * self._velocity_m_s - sunk_m * UP

    def observe(self):
        return Observation((ObjectPose("cube", self.cube_m()),))

    def execute(self, action):
        self.now_s += ACTION_S
        self.done.append((action.position_m, self.cube_m()))

    def stop(self):
        self.stopped += 1


class SlowService(Service):
    def __init__(self, belt, limits=None):
        actions = tuple(EndEffectorAction(CUBE_M + height_m * UP, DOWN, is_open) for height_m, is_open in PICK)
        anchors = (ActionAnchor("cube", "w", np.zeros(3), DOWN),) * len(PICK)
        super().__init__(PredictedActions("p", actions, {"findings": []}, anchors), limits=limits)
        self._belt = belt

    def predict(self, task, instruction, observation, **options):
        self._belt.now_s += ANSWER_S
        return super().predict(task, instruction, observation, **options)


def run(belt, limits=None):
    how = {"look_again": True, "leading": Leading(LEAD_S, lambda: belt.now_s)}
    return run_task(SlowService(belt, limits), belt, "pick", "pick up the cube", **how)


def test_the_fingers_close_where_the_cube_will_be():
    belt = Belt(0.05 * ALONG_Y)
    run(belt)
    looked_s = ANSWER_S + ACTION_S  # before the second action
    closed_m, _ = belt.done[1]
    np.testing.assert_allclose(closed_m, CUBE_M + (looked_s + LEAD_S) * 0.05 * ALONG_Y)
    lifted_m, _ = belt.done[2]
    np.testing.assert_allclose(lifted_m - closed_m, 0.1 * UP, err_msg="what is in the hand is not led")


def test_what_rests_is_not_led():
    belt = Belt(0.002 * ALONG_Y)  # an estimator's noise looks like this
    run(belt)
    assert [place_m[1] for place_m, _ in belt.done] == [0.0, pytest.approx(0.006), pytest.approx(0.006)]


@pytest.mark.parametrize(
    ("speed_m_s", "sinks_after_s", "said", "done"),
    [
        (0.05, ANSWER_S + 0.5 * ACTION_S, r"changed by -2\.0 cm", 1),
        (0.05, 0.5 * ANSWER_S, "left its conveyor", 0),
        (0.2, np.inf, "moves at 20 cm/s, 15 cm/s at most", 0),
    ],
)
def test_an_object_that_falls_off_or_is_too_fast_stops_the_robot(speed_m_s, sinks_after_s, said, done):
    belt = Belt(speed_m_s * ALONG_Y, sinks_after_s)
    with pytest.raises(ObjectLostError, match=said):
        run(belt)
    assert (len(belt.done), belt.stopped) == (done, 1)


def test_where_it_will_be_must_lie_within_the_limits():
    belt = Belt(0.1 * ALONG_Y)
    with pytest.raises(UnsafeActionError, match=r"action 0: position\.y is 0\.25 m"):
        run(belt, limits=MotionLimits(Box((-1, -1, 0), (1, 0.2, 2))))
    assert (belt.done, belt.stopped) == ([], 1)


def test_two_looks_that_follow_each_other_closely_say_nothing():
    leading = Leading(LEAD_S)
    poses = [ObjectPose("cube", CUBE_M + k * 0.01 * ALONG_Y) for k in range(3)]
    leading.note({"cube": poses[0]}, 0.0)
    leading.note({"cube": poses[1]}, 0.1)
    assert leading.ahead("cube", poses[1]) is poses[1]
    leading.note({"cube": poses[2]}, 0.4)
    np.testing.assert_allclose(leading.ahead("cube", poses[2]).position_m, CUBE_M + (0.02 + LEAD_S * 0.05) * ALONG_Y)


@pytest.mark.parametrize("lead_s", [0.0, -1.0, float("nan"), float("inf"), 11.0])
def test_a_lead_is_a_time(lead_s):
    with pytest.raises(InvalidInputError, match=r"lead_s: is .*seconds above 0, 10 at most"):
        Leading(lead_s)


def test_leading_needs_looks():
    belt = Belt(0.05 * ALONG_Y)
    with pytest.raises(InvalidInputError, match="leading: is given, but the robot does not look again"):
        run_task(SlowService(belt), belt, "pick", "pick up the cube", leading=Leading(LEAD_S))
    assert belt.stopped == 1
