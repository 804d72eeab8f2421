"""The robot's loop: whatever goes wrong, the arm is stopped."""

import numpy as np
import pytest

from app.client.client import PredictedActions
from app.client.errors import ServiceProblemError
from app.client.loop import NotConfirmedError, run_task
from app.client.robot import MotionError, Observation
from app.pipeline.episode import EndEffectorAction, ObjectPose

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

    def predict(self, task, instruction, observation, **options):
        if isinstance(self._outcome, Exception):
            raise self._outcome
        return self._outcome


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
    assert (arm.heights, arm.stopped) == ([], 0)
