"""Observe, ask, act: the loop of a robot that uses the service."""

from collections.abc import Callable, Iterator
from typing import Any

from app.client.client import PredictedActions, RoboPromptClient
from app.client.robot import Robot
from app.pipeline.episode import EndEffectorAction
from app.pipeline.reply import MAX_ACTIONS

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
    stream: bool = False,
    **options: Any,  # noqa: ANN401
) -> PredictedActions:
    """Let the robot carry out one instruction; returns what was predicted.

    Whatever goes wrong in between, the robot is stopped where it is before the error goes on.

    Args:
        confirm: asked before each action, with its index; the run ends where it says no.
        stream: begin to move while the LLM still writes; otherwise nothing moves until the whole reply is known to be
            a valid list of actions.
        options: as for `RoboPromptClient.predict`.

    Raises:
        ServiceProblemError, ServiceUnreachableError: without `stream` nothing was moved.
        MotionError: if an action could not be carried out.
        NotConfirmedError: if `confirm` said no.
    """
    observation = robot.observe()
    predicted = None if stream else client.predict(task, instruction, observation, **options)
    try:
        if predicted is not None:
            for index, action in enumerate(predicted.actions):
                _execute(robot, index, action, confirm)
            return predicted
        for index, item in enumerate(client.stream(task, instruction, observation, **options)):
            if isinstance(item, PredictedActions):
                return item
            _execute(robot, index, item, confirm)
        raise AssertionError("a stream ends with the whole answer or an error")
    except BaseException:
        robot.stop()
        raise


def run_closed_loop(
    client: RoboPromptClient,
    robot: Robot,
    task: str,
    instruction: str,
    *,
    max_steps: int = MAX_ACTIONS,
    confirm: Confirm | None = None,
    **options: Any,  # noqa: ANN401
) -> Iterator[PredictedActions]:
    """Observe, ask for one action, carry it out, and again, until the LLM says that it is done.

    Args:
        max_steps: after so many the run ends, done or not.
        confirm, options: as for `run_task`.

    Yields:
        the answer to each step, before its action is carried out; the last has no action unless `max_steps` ended the
        run.

    Raises:
        as `run_task`; the robot is stopped before.
    """
    wish = {**options, "closed_loop": True}
    try:
        for index in range(max_steps):
            predicted = client.predict(task, instruction, robot.observe(), **wish)
            yield predicted
            if not predicted.actions:
                return
            _execute(robot, index, predicted.actions[0], confirm)
            wish["after"] = predicted.id
    except BaseException:
        robot.stop()
        raise


def _execute(robot: Robot, index: int, action: EndEffectorAction, confirm: Confirm | None) -> None:
    if confirm is not None and not confirm(index, action):
        raise NotConfirmedError(f"action {index + 1} was not allowed")
    robot.execute(action)
