"""The robot's loop: whatever goes wrong, the arm is stopped."""

import numpy as np
import pytest

from app.client.client import PredictedActions
from app.client.errors import ServiceProblemError
from app.client.loop import NotConfirmedError, run_task
from app.client.robot import MotionError, Observation
from app.pipeline.episode import EndEffectorAction, ObjectPose
from app.pipeline.errors import UnsafeActionError
from app.pipeline.motion_limits import Box, MotionLimits

ACTIONS = tuple(EndEffectorAction(np.array([0.1, 0.2, z]), np.array([1.0, 0, 0, 0]), True) for z in (1.0, 0.9, 0.8))


class Arm:
    """A robot that notes what it is told, and fails at a given action."""

    def __init__(self, fails_at=None, error=None):
        self.heights, self.stopped, self._fails_at, self._error = [], 0, fails_at, error

    def observe(self):
        return Observation((ObjectPose("cube", np.zeros(3)),))

    def execute(self, action):
        if len(self.heights) == self._fails_at:
            raise self._error
        self.heights.append(float(action.position_m[2]))

    def stop(self):
        self.stopped += 1


class Service:
    """A client whose service answers `outcome`, or raises it."""

    def __init__(self, outcome):
        self._outcome = outcome

    def motion_limits(self, task):
        return MotionLimits(Box((-1, -1, 0), (1, 1, 2)))

    def predict(self, task, instruction, observation, **options):
        if isinstance(self._outcome, Exception):
            raise self._outcome
        return self._outcome

    def stream(self, task, instruction, observation, **options):
        yield from self._outcome.actions
        yield self._outcome


ANSWER = PredictedActions("p", ACTIONS, {})


def test_actions_are_executed_in_order():
    arm = Arm()
    assert run_task(Service(ANSWER), arm, "pick", "pick up the cube") is ANSWER
    assert (arm.heights, arm.stopped) == ([1.0, 0.9, 0.8], 0)


@pytest.mark.parametrize("error", [MotionError("blocked"), KeyboardInterrupt(), RuntimeError("cable")])
def test_the_arm_is_stopped_where_it_fails(error):
    arm = Arm(fails_at=1, error=error)
    with pytest.raises(type(error)):
        run_task(Service(ANSWER), arm, "pick", "pick up the cube")
    assert (arm.heights, arm.stopped) == ([1.0], 1)


def test_a_person_can_stop_before_an_action():
    arm = Arm()
    with pytest.raises(NotConfirmedError, match="action 2 was not allowed"):
        run_task(Service(ANSWER), arm, "pick", "pick up the cube", confirm=lambda index, action: index < 1)
    assert (arm.heights, arm.stopped) == ([1.0], 1)


def test_nothing_moves_without_an_answer():
    arm = Arm()
    with pytest.raises(ServiceProblemError):
        run_task(Service(ServiceProblemError(502, {"title": "no"})), arm, "pick", "pick up the cube")
    assert (arm.heights, arm.stopped) == ([], 1)


HIGH = MotionLimits(Box((-1, -1, 0.85), (1, 1, 2)))


@pytest.mark.parametrize(("stream", "carried_out"), [(False, []), (True, [1.0, 0.9])])
def test_limits_of_its_own_hold_whatever_the_service_says(stream, carried_out):
    arm = Arm()
    with pytest.raises(UnsafeActionError, match=r"action 2: position.z is 0.8 m"):
        run_task(Service(ANSWER), arm, "pick", "pick up the cube", limits=HIGH, stream=stream)
    assert (arm.heights, arm.stopped) == (carried_out, 1)


@pytest.mark.parametrize("stream", [False, True])
def test_more_actions_than_asked_for_are_not_carried_out(stream):
    arm = Arm()
    with pytest.raises(UnsafeActionError, match="at most 2 actions"):
        run_task(Service(ANSWER), arm, "pick", "pick up the cube", max_actions=2, stream=stream)
    assert arm.stopped == 1
