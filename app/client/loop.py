"""Observe, ask, act: the loop of a robot that uses the service."""

from collections.abc import Callable, Iterator
from typing import Any

from app.client.client import PredictedActions, RoboPromptClient
from app.client.robot import Robot
from app.pipeline.episode import EndEffectorAction
from app.pipeline.motion_guard import MotionGuard
from app.pipeline.motion_limits import MotionLimits
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
    limits: MotionLimits | None = None,
    pinned: MotionLimits | None = None,
    confirm: Confirm | None = None,
    stream: bool = False,
    **options: Any,  # noqa: ANN401
) -> PredictedActions:
    """Let the robot carry out one instruction; returns what was predicted.

    Whatever goes wrong, Ctrl-C included, the robot is stopped where it is before the error goes on.

    Args:
        limits: what the robot may be told, whatever the service says; None: what the service says of the task.
        pinned: bounds of the robot's own that hold as well, so that nobody at the service can widen them.
        confirm: asked before each action, with its index; the run ends where it says no.
        stream: begin to move while the LLM still writes; otherwise nothing moves until the whole reply is known to be
            a list of actions within the limits.
        options: as for `RoboPromptClient.predict`.

    Raises:
        InvalidInputError: if the service's limits cannot be held (NaN, say) or leave no room within the pinned ones, or
            if steps are bounded and the observation lacks `end_effector`; nothing was asked or moved.
        ServiceProblemError, ServiceUnreachableError: without `stream` nothing was moved.
        UnsafeActionError: if an action is beyond the limits; it was not carried out, and without `stream` none was.
        MotionError: if an action could not be carried out.
        NotConfirmedError: if `confirm` said no.
    """
    try:
        allowed = _allowed(client, task, limits, pinned)
        observation = robot.observe()
        allowed.require_start(observation.end_effector)
        guard = MotionGuard(allowed, options.get("max_actions", MAX_ACTIONS), observation.end_effector)
        if stream:
            return _run_streamed(client.stream(task, instruction, observation, **options), robot, guard, confirm)
        predicted = client.predict(task, instruction, observation, **options)
        for action in predicted.actions:
            guard.check(action)
        for index, action in enumerate(predicted.actions):
            _execute(robot, index, action, confirm)
    except BaseException:
        robot.stop()
        raise
    return predicted


def _run_streamed(
    arriving: Iterator[EndEffectorAction | PredictedActions], robot: Robot, guard: MotionGuard, confirm: Confirm | None
) -> PredictedActions:
    for index, item in enumerate(arriving):
        if isinstance(item, PredictedActions):
            return item
        guard.check(item)
        _execute(robot, index, item, confirm)
    raise AssertionError("a stream ends with the whole answer or an error")


def run_closed_loop(
    client: RoboPromptClient,
    robot: Robot,
    task: str,
    instruction: str,
    *,
    max_steps: int = MAX_ACTIONS,
    limits: MotionLimits | None = None,
    pinned: MotionLimits | None = None,
    confirm: Confirm | None = None,
    **options: Any,  # noqa: ANN401
) -> Iterator[PredictedActions]:
    """Observe, ask for one action, carry it out, and again, until the LLM says that it is done.

    Args:
        max_steps: after so many the run ends, done or not.
        limits, pinned, confirm, options: as for `run_task`.

    Yields:
        the answer to each step, before its action is carried out; the last has no action unless `max_steps` ended the
        run.

    Raises:
        as `run_task`; the robot is stopped before.
    """
    wish = {**options, "closed_loop": True}
    guard: MotionGuard | None = None
    try:
        allowed = _allowed(client, task, limits, pinned)
        for index in range(max_steps):
            observation = robot.observe()
            if guard is None:
                allowed.require_start(observation.end_effector)
                guard = MotionGuard(allowed, max_steps, observation.end_effector)
            predicted = client.predict(task, instruction, observation, **wish)
            for action in predicted.actions:
                guard.check(action)
            yield predicted
            if not predicted.actions:
                return
            _execute(robot, index, predicted.actions[0], confirm)
            wish["after"] = predicted.id
    except BaseException:
        robot.stop()
        raise


def _allowed(
    client: RoboPromptClient, task: str, limits: MotionLimits | None, pinned: MotionLimits | None
) -> MotionLimits:
    told = limits or client.motion_limits(task)
    return told if pinned is None else told.intersection(pinned)


def _execute(robot: Robot, index: int, action: EndEffectorAction, confirm: Confirm | None) -> None:
    if confirm is not None and not confirm(index, action):
        raise NotConfirmedError(f"action {index + 1} was not allowed")
    robot.execute(action)
