"""Observe, ask, act: the loop of a robot that uses the service, for one task or for a sentence over several."""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from roboprompt_client.answers import Confirm, OnDanger, Outcome, PlannedStep, PredictedActions, require_allowed
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import (
    InvalidInputError,
    NotConfirmedError,
    ServiceProblemError,
    ServiceUnreachableError,
    StepFailedError,
)
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MAX_ACTIONS, MotionLimits
from roboprompt_client.robot import ChecksPlans, Observation, Robot, stop_after_error
from roboprompt_client.runs.look_again import Follower, ObjectFinder
from roboprompt_client.types.poses import EndEffectorAction

Preview = Callable[[Sequence[EndEffectorAction], MotionLimits, str], None]
ConfirmSteps = Callable[[Sequence[PlannedStep]], bool]
OnOutcome = Callable[[PredictedActions], Outcome | None]
log = logging.getLogger(__name__)


def run_task(
    client: RoboPromptClient,
    robot: Robot,
    task: str,
    instruction: str,
    *,
    pinned: MotionLimits | None = None,
    confirm: Confirm | None = None,
    look_again: bool = False,
    on_danger: OnDanger = "refuse",
    preview: Preview | None = None,
    on_outcome: OnOutcome | None = None,
    **options: Any,  # noqa: ANN401
) -> PredictedActions:
    """Let the robot carry out one instruction; return the prediction.

    Nothing moves before all actions are checked. After any error, also Ctrl-C, the robot is stopped before the error is
    raised.

    Args:
        pinned: limits of the robot's own, which hold beside the task's: the service cannot widen them.
        confirm: asked before each action, with its index; the run ends if it returns False.
        look_again: observe again before contact (see the module `look_again`) and move the remaining actions along
            with their objects; the returned prediction has the actions as they were carried out.
        on_danger: what to do about a finding of severity `danger` before anything moves: `refuse`, `go`, or a function
            that is asked with its message; the run ends if it returns False.
        preview: called with the actions, the limits and the prediction's id before the actions are checked.
        on_outcome: called with the prediction that was carried out; the outcome that it returns is recorded at the
            service. A failure to record is only logged.
        options: those of `RoboPromptClient.predict`.

    Raises:
        InvalidInputError: if limits are invalid or leave no room, or steps are bounded and the observation lacks
            `end_effector`; nothing was moved.
        ServiceProblemError, ServiceUnreachableError: nothing was moved.
        InvalidAnswerError: if the findings are missing or malformed; nothing was moved.
        UnsafeActionError: if an action is beyond the limits; nothing was moved.
        MotionError: if an action is out of reach, where the robot knows that before it moves, or failed.
        NotConfirmedError: if `confirm` or `on_danger` returned False.
        DangerError: if a finding is a danger and `on_danger` is `refuse`; nothing was moved.
        ObjectLostError: if an object is not seen again.
    """
    try:
        if on_danger not in ("refuse", "go") and not callable(on_danger):
            raise InvalidInputError("on_danger", f"is {on_danger!r:.40}", "refuse, go, or a function of the message")
        of_task = client.motion_limits(task)
        limits = of_task if pinned is None else of_task.intersection(pinned)
        observation = robot.observe()
        check = partial(_check, limits, int(options.get("max_actions") or MAX_ACTIONS), observation)
        check(())  # refuse a missing start pose before the service is asked
        finder = ObjectFinder(client, robot, task, observation) if look_again else None
        predicted = client.predict(task, instruction, observation, **options)
        if preview is not None:
            preview(predicted.actions, limits, predicted.id)
        check(predicted.actions)
        if isinstance(robot, ChecksPlans):
            robot.check_plan(predicted.actions)
        require_allowed(predicted.findings if predicted.actions else (), on_danger)
        follower = None if finder is None else Follower(finder, predicted, observation, check)
        predicted = _carried_out(robot, predicted, confirm, follower)
    except BaseException:
        stop_after_error(robot)
        raise
    if on_outcome is not None and predicted.actions:
        record_outcome(client, predicted, on_outcome)
    return predicted


def _check(
    limits: MotionLimits, max_actions: int, observation: Observation, actions: Sequence[EndEffectorAction]
) -> None:
    """Check actions that begin where the robot is in `observation`."""
    limits.require_start(observation.end_effector)
    guard = MotionGuard(limits, max_actions, observation.end_effector)
    for action in actions:
        guard.check(action)


def _carried_out(
    robot: Robot, predicted: PredictedActions, confirm: Confirm | None, follower: Follower | None
) -> PredictedActions:
    """Carry out the actions that `confirm` allows; return the prediction with them."""
    for index, planned in enumerate(predicted.actions):
        action = planned if follower is None else follower.before(index)
        if confirm is not None and not confirm(index, action):
            raise NotConfirmedError(f"action {index + 1} was not allowed")
        robot.execute(action)
        if follower is not None:
            follower.after(index)
    return predicted if follower is None else replace(predicted, actions=follower.actions)


def record_outcome(client: RoboPromptClient, predicted: PredictedActions, on_outcome: OnOutcome) -> Outcome | None:
    """Return what `on_outcome` says of actions that were carried out, and record it; a failure to record is logged."""
    if (outcome := on_outcome(predicted)) is not None:
        try:
            client.record_outcome(predicted.id, *outcome)
        except (ServiceProblemError, ServiceUnreachableError) as error:  # the task is done nevertheless
            log.warning("the outcome was not recorded: %s", error)
    return outcome


def run_plan(
    client: RoboPromptClient,
    robot: Robot,
    text: str,
    *,
    confirm_steps: ConfirmSteps | None = None,
    on_outcome: OnOutcome | None = None,
    **how: Any,  # noqa: ANN401
) -> list[PredictedActions]:
    """Let the robot carry out a sentence over several tasks; return the prediction of each step.

    Before each step the robot observes the scene again; each task is asked with its own objects only. The first
    refusal, danger, failed motion or outcome other than success ends the plan and stops the robot.

    Args:
        confirm_steps: asked once before anything moves.
        on_outcome: called after each step; the plan goes on only after a success. None: what was carried out is done.
        how: arguments of `run_task`, for each step.

    Raises:
        RoboPromptError: as `RoboPromptClient.plan` and `run_task`.
        NotConfirmedError: if `confirm_steps` returned False; nothing was moved.
        StepFailedError: if a step has no actions, or its outcome is not a success.
    """
    seen = robot.observe()
    steps = client.plan(text, (*seen.objects, *seen.to_find))
    if confirm_steps is not None and not confirm_steps(steps):
        raise NotConfirmedError("the plan was not allowed")
    done: list[PredictedActions] = []
    for number, step in enumerate(steps, start=1):
        log.info("step %d of %d: %s (%s)", number, len(steps), step.instruction, step.task)
        try:
            done.append(_run_step(client, robot, step, on_outcome, how))
        except StepFailedError as error:
            stop_after_error(robot)
            raise StepFailedError(f"step {number} of {len(steps)}, {step.instruction!r}: {error}") from None
    return done


def _run_step(
    client: RoboPromptClient, robot: Robot, step: PlannedStep, on_outcome: OnOutcome | None, how: Mapping[str, Any]
) -> PredictedActions:
    names = client.get(f"/tasks/{step.task}").get("object_names") or ()
    predicted = run_task(client, _OnlyObjects(robot, names), step.task, step.instruction, **how)
    if not predicted.actions:
        raise StepFailedError("the service's answer has no actions")
    if on_outcome is None:
        return predicted
    if (outcome := record_outcome(client, predicted, on_outcome)) is None:
        raise StepFailedError("it is not known whether it worked")
    if not outcome.success:
        raise StepFailedError(outcome.note or "it did not work")
    return predicted


@dataclass(frozen=True)
class _OnlyObjects:
    """The robot, whose observations have some objects only."""

    robot: Robot
    names: Collection[str]

    def check_plan(self, actions: Sequence[EndEffectorAction]) -> None:
        if isinstance(self.robot, ChecksPlans):
            self.robot.check_plan(actions)

    def observe(self) -> Observation:
        seen = self.robot.observe()
        objects = [pose for pose in seen.objects if pose.name in self.names]
        to_find = [name for name in seen.to_find if name in self.names]
        mask_ids = {name: ids for name, ids in seen.mask_ids.items() if name in self.names}
        return Observation(objects, seen.frames, to_find, seen.end_effector, mask_ids)

    def execute(self, action: EndEffectorAction) -> None:
        self.robot.execute(action)

    def stop(self) -> None:
        self.robot.stop()
