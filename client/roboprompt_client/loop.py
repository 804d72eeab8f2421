"""Observe, ask, act: the loop of a robot that uses the service."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from roboprompt_client.answers import PredictedActions
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.danger import Confirm, OnDanger, heed, what_to_do
from roboprompt_client.errors import InvalidInputError, NotConfirmedError
from roboprompt_client.leading import Leading
from roboprompt_client.look_again import Eyes, Follower
from roboprompt_client.motion_guard import MotionGuard
from roboprompt_client.motion_limits import MAX_ACTIONS, MotionLimits
from roboprompt_client.robot import Robot
from roboprompt_client.trajectory import EndEffectorAction

Preview = Callable[[Sequence[EndEffectorAction], MotionLimits], None]


def show_nothing(actions: Sequence[EndEffectorAction], limits: MotionLimits) -> None:
    """A preview for a loop that nobody watches."""


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
    look_again: bool = False,
    leading: Leading | None = None,
    on_danger: OnDanger | None = None,
    preview: Preview = show_nothing,
    **options: Any,  # noqa: ANN401
) -> PredictedActions:
    """Let the robot carry out one instruction; returns what was predicted.

    Whatever goes wrong, Ctrl-C included, the robot is stopped where it is before the error goes on.

    Args:
        limits: what the robot may do, whatever the service says; None: what the service says of the task.
        pinned: bounds of the robot's own that hold as well, so that nobody at the service can widen them.
        confirm: asked before each action, with its index; the run ends where it says no.
        stream: begin to move while the LLM still writes; otherwise nothing moves until the whole reply is known to be
            a list of actions within the limits.
        look_again: observe again before contact (the module `look_again` says when) and move the remaining actions
            along with the objects that they hang on, without asking the LLM; what is returned has the actions as they
            were carried out. Not together with `stream`.
        leading: with `look_again`, of objects that move by themselves: go where they will be at contact, by their
            velocity between looks, instead of where they were seen (the module `leading`).
        on_danger: where the service finds its own answer dangerous: ask `confirm` before anything moves, refuse, or go
            on all the same. None: `confirm` where there is one, else `refuse`. With `stream` this holds for what is
            found ahead of the first action.
        preview: shown the actions and the limits that hold, before they are held against each other and before anything
            moves; with `stream` each action as it comes.
        options: as for `RoboPromptClient.predict`.

    Raises:
        InvalidInputError: if the service's limits cannot be held (NaN, say) or leave no room within the pinned ones, or
            if steps are bounded and the observation lacks `end_effector`; nothing was asked or moved.
        ServiceProblemError, ServiceUnreachableError: without `stream` nothing was moved.
        UnsafeActionError: if an action is beyond the limits; it was not carried out, and without `stream` none was.
        MotionError: if an action could not be carried out.
        NotConfirmedError: if `confirm` said no.
        DangerError: if the answer is dangerous and `on_danger` refuses it; nothing was moved.
        ObjectLostError: if an object that is looked for again is not seen; with `leading` also if it has left what
            carried it, or moves too fast.
        InvalidInputError: if `look_again` or `on_danger` cannot be had; nothing was moved.
    """
    try:
        danger = what_to_do(on_danger, confirm)
        _check_modes(look_again=look_again, stream=stream, leads=leading is not None)
        allowed = _allowed(client, task, limits, pinned)
        looked_s = 0.0 if leading is None else leading.clock()
        observation = robot.observe()
        allowed.require_start(observation.end_effector)
        new_guard = partial(MotionGuard, allowed, options.get("max_actions", MAX_ACTIONS), observation.end_effector)
        if stream:
            findings: list[Mapping[str, Any]] = []
            arriving = client.stream(task, instruction, observation, on_findings=findings.extend, **options)
            first = partial(heed, findings, on_danger=danger, confirm=confirm)
            return _run_streamed(_previewed(arriving, preview, allowed), robot, new_guard(), confirm, first)
        eyes = Eyes(client, robot, task, observation) if look_again else None
        predicted = client.predict(task, instruction, observation, **options)
        preview(predicted.actions, allowed)
        check = partial(_check_all, new_guard)
        check(predicted.actions)
        heed(predicted.findings, predicted.actions, on_danger=danger, confirm=confirm)
        if eyes is not None:
            if leading is not None:
                seen = observation.objects or predicted.objects
                leading.saw({pose.name: pose for pose in seen}, looked_s)
            follower = Follower(eyes, predicted, observation, check, leading=leading)
            return _run_following(follower, robot, predicted, confirm)
        for index, action in enumerate(predicted.actions):
            _execute(robot, index, action, confirm)
    except BaseException:
        robot.stop()
        raise
    return predicted


def _check_modes(*, look_again: bool, stream: bool, leads: bool) -> None:
    if leads and not look_again:
        raise InvalidInputError("leading", "is given, but the robot does not look again", "look_again=True")
    if look_again and stream:
        message = "is asked for together with stream, which moves before all actions are known"
        raise InvalidInputError("look_again", message, "one of both")


def _check_all(new_guard: Callable[[], MotionGuard], actions: tuple[EndEffectorAction, ...]) -> None:
    guard = new_guard()
    for action in actions:
        guard.check(action)


def _run_following(
    follower: Follower, robot: Robot, predicted: PredictedActions, confirm: Confirm | None
) -> PredictedActions:
    for index in range(len(predicted.actions)):
        _execute(robot, index, follower.before(index), confirm)
        follower.after(index)
    return replace(predicted, actions=follower.actions)


def _previewed(
    arriving: Iterator[EndEffectorAction | PredictedActions], preview: Preview, allowed: MotionLimits
) -> Iterator[EndEffectorAction | PredictedActions]:
    for item in arriving:
        if isinstance(item, EndEffectorAction):
            preview((item,), allowed)
        yield item


def _run_streamed(
    arriving: Iterator[EndEffectorAction | PredictedActions],
    robot: Robot,
    guard: MotionGuard,
    confirm: Confirm | None,
    heed_before: Callable[[tuple[EndEffectorAction, ...]], None],
) -> PredictedActions:
    for index, item in enumerate(arriving):
        if isinstance(item, PredictedActions):
            return item
        guard.check(item)
        if index == 0:
            heed_before((item,))
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
    on_danger: OnDanger | None = None,
    preview: Preview = show_nothing,
    **options: Any,  # noqa: ANN401
) -> Iterator[PredictedActions]:
    """Observe, ask for one action, carry it out, and again, until the LLM says that it is done.

    Args:
        max_steps: after so many the run ends, done or not.
        limits, pinned, confirm, on_danger, preview, options: as for `run_task`; a danger is heeded at each step that
            has one, and each step's action is shown.

    Yields:
        the answer to each step, before a danger in it is heeded and its action is carried out; the last has no action
        unless `max_steps` ended the run.

    Raises:
        as `run_task`; the robot is stopped before.
    """
    asked = {**options, "closed_loop": True}
    guard: MotionGuard | None = None
    try:
        danger = what_to_do(on_danger, confirm)
        allowed = _allowed(client, task, limits, pinned)
        for index in range(max_steps):
            observation = robot.observe()
            if guard is None:
                allowed.require_start(observation.end_effector)
                guard = MotionGuard(allowed, max_steps, observation.end_effector)
            predicted = client.predict(task, instruction, observation, **asked)
            preview(predicted.actions, allowed)
            for action in predicted.actions:
                guard.check(action)
            yield predicted
            if not predicted.actions:
                return
            heed(predicted.findings, predicted.actions, on_danger=danger, confirm=confirm)
            _execute(robot, index, predicted.actions[0], confirm)
            asked["after"] = predicted.id
    except BaseException:
        robot.stop()
        raise


def _allowed(
    client: RoboPromptClient, task: str, limits: MotionLimits | None, pinned: MotionLimits | None
) -> MotionLimits:
    of_task = limits or client.motion_limits(task)
    return of_task if pinned is None else of_task.intersection(pinned)


def _execute(robot: Robot, index: int, action: EndEffectorAction, confirm: Confirm | None) -> None:
    if confirm is not None and not confirm(index, action):
        raise NotConfirmedError(f"action {index + 1} was not allowed")
    robot.execute(action)
