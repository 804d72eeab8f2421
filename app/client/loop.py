"""Observe, ask, act: the loop of a robot that uses the service."""

from collections.abc import Callable
from typing import Any

from app.client.client import PredictedActions, RoboPromptClient
from app.client.robot import Robot
from app.pipeline.episode import EndEffectorAction

Confirm = Callable[[int, EndEffectorAction], bool]


class NotConfirmedError(Exception):
    """A person did not allow an action."""


def run_task(
    client: RoboPromptClient,
    robot: Robot,
    task: str,
    instruction: str,
    *,
    confirm: Confirm | None = None,
    **options: Any,  # noqa: ANN401
) -> PredictedActions:
    """Let the robot carry out one instruction; returns what was predicted.

    Whatever goes wrong in between, the robot is stopped where it is before the error goes on.

    Args:
        confirm: asked before each action, with its index; the run ends where it says no.
        options: as for `RoboPromptClient.predict`.

    Raises:
        ServiceProblemError, ServiceUnreachableError: nothing was moved.
        MotionError: if an action could not be carried out.
        NotConfirmedError: if `confirm` said no.
    """
    predicted = client.predict(task, instruction, robot.observe(), **options)
    try:
        for index, action in enumerate(predicted.actions):
            if confirm is not None and not confirm(index, action):
                raise NotConfirmedError(f"action {index + 1} of {len(predicted.actions)} was not allowed")
            robot.execute(action)
    except BaseException:
        robot.stop()
        raise
    return predicted
