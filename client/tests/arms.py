"""A robot, a service and a person of the tests' own."""

import httpx
import numpy as np

from roboprompt_client import cli
from roboprompt_client.answers import PredictedActions
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

ACTIONS = tuple(EndEffectorAction(np.array([0.1, 0.2, z]), np.array([1.0, 0, 0, 0]), True) for z in (1.0, 0.9, 0.8))


class Arm:
    """A robot that notes its commands, and fails at a given action."""

    def __init__(self, fails_at=None, error=None, end_effector=None):
        self._end_effector = end_effector
        self.heights, self.stopped, self._fails_at, self._error = [], 0, fails_at, error

    def observe(self):
        return Observation((ObjectPose("cube", np.zeros(3)),), end_effector=self._end_effector)

    def execute(self, action):
        if len(self.heights) == self._fails_at:
            raise self._error
        self.heights.append(float(action.position_m[2]))

    def stop(self):
        self.stopped += 1


class Service:
    """A client whose service answers `outcome`, or raises it."""

    def __init__(self, outcome, limits=MotionLimits(Box((-1, -1, 0), (1, 1, 2)))):  # noqa: B008
        self._outcome, self._limits, self.asked = outcome, limits, 0

    def motion_limits(self, task):
        return self._limits

    def predict(self, task, instruction, observation, **options):
        self.asked += 1
        if isinstance(self._outcome, Exception):
            raise self._outcome
        return self._outcome


ANSWER = PredictedActions("p", ACTIONS, {"findings": []})


def client_of(answer):
    """A client whose requests are answered by a function, or all with one response."""
    answers = (lambda _: answer) if isinstance(answer, httpx.Response) else answer
    return RoboPromptClient(connection=httpx.Client(transport=httpx.MockTransport(answers), base_url="http://robots"))


def type_command(monkeypatch, *words, answers=()):
    """The exit status of `roboprompt-robot`, and what it asks; a person gives the answers and then leaves.

    Args:
        answers: texts, errors to raise, or functions that are called before their text is typed.
    """
    left, asked = list(answers), []

    def type_next(question):
        asked.append(question)
        if not left:
            raise EOFError
        answer = left.pop(0)
        if isinstance(answer, BaseException):
            raise answer
        return answer() if callable(answer) else answer

    monkeypatch.setattr("builtins.input", type_next)
    monkeypatch.setattr("sys.argv", ["roboprompt-robot", *map(str, words)])
    return cli.main(), asked
