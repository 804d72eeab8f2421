"""Observe, ask, act: the loop of a robot that uses the service."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

from roboprompt_client.answers import (
    Confirm,
    OnDanger,
    Outcome,
    PredictedActions,
    checked_on_danger,
    require_allowed,
)
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import (
    NotConfirmedError,
    ServiceProblemError,
    ServiceUnreachableError,
)
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MAX_ACTIONS, MotionLimits
from roboprompt_client.robot import ChecksPlans, Observation, Robot, stop_after_error
from roboprompt_client.runs.look_again import Follower, ObjectFinder
from roboprompt_client.types.poses import EndEffectorAction

Preview = Callable[[Sequence[EndEffectorAction], MotionLimits, str], None]
OnOutcome = Callable[[PredictedActions], Outcome | None]
log = logging.getLogger(__name__)


def show_nothing(*_: object) -> None:
    """Do nothing: the preview of a run without a person."""


@dataclass(frozen=True)
class RunOptions:
    """How a robot carries out an instruction.

    Attributes:
        pinned: limits of the robot's own, which hold beside the task's: the service cannot widen them.
        confirm: asked before each action, with its index; the run ends if it returns False.
        look_again: observe again before contact (see the module `look_again`) and move the remaining actions along
            with their objects; the returned prediction has the actions as they were carried out.
        on_danger: what to do about a finding of severity `danger` before anything moves: `refuse`, `go`, or a function
            that is asked with its message; the run ends if it returns False.
        preview: called with the actions, the limits and the prediction's id before the actions are checked and anything
            moves.
        on_outcome: called with the prediction that was carried out; the outcome that it returns is recorded at the
            service. A failure to record is only logged.

    Raises:
        InvalidInputError: if they contradict each other.
    """

    pinned: MotionLimits | None = None
    confirm: Confirm | None = None
    look_again: bool = False
    on_danger: OnDanger = "refuse"
    preview: Preview = show_nothing
    on_outcome: OnOutcome | None = None

    def __post_init__(self) -> None:
        checked_on_danger(self.on_danger)


def run_task(
    client: RoboPromptClient,
    robot: Robot,
    task: str,
    instruction: str,
    **options: Any,  # noqa: ANN401
) -> PredictedActions:
    """Let the robot carry out one instruction; return the prediction.

    After any error, also Ctrl-C, the robot is stopped before the error is raised.

    Args:
        options: those of `RunOptions`, and those of `RoboPromptClient.predict`.

    Raises:
        InvalidInputError: if options contradict each other, limits are invalid or leave no room, or steps are
            bounded and the observation lacks `end_effector`; nothing was moved.
        ServiceProblemError, ServiceUnreachableError: nothing was moved.
        InvalidAnswerError: if the findings are missing or malformed; nothing was moved.
        UnsafeActionError: if an action is beyond the limits; nothing was moved.
        MotionError: if an action is out of reach, where the robot knows that before it moves, or failed.
        NotConfirmedError: if `confirm` or `on_danger` returned False.
        DangerError: if a finding is a danger and `on_danger` is `refuse`; nothing was moved.
        ObjectLostError: if an object is not seen again.
    """
    own = {field.name for field in fields(RunOptions)}
    try:
        how = RunOptions(**{name: option for name, option in options.items() if name in own})
        of_task = client.motion_limits(task)
        allowed = of_task if how.pinned is None else of_task.intersection(how.pinned)
        asked = {name: option for name, option in options.items() if name not in own}
        run = _Run(client, robot, task, instruction, allowed, how, asked)
        predicted = run.carry_out()
    except BaseException:
        stop_after_error(robot)
        raise
    if how.on_outcome is not None and predicted.actions:
        record_outcome(client, predicted, how.on_outcome)
    return predicted


def record_outcome(client: RoboPromptClient, predicted: PredictedActions, on_outcome: OnOutcome) -> Outcome | None:
    """Return what `on_outcome` says of actions that were carried out, and record it; a failure to record is logged."""
    if (outcome := on_outcome(predicted)) is not None:
        try:
            client.record_outcome(predicted.id, *outcome)
        except (ServiceProblemError, ServiceUnreachableError) as error:  # the task is done nevertheless
            log.warning("the outcome was not recorded: %s", error)
    return outcome


@dataclass(frozen=True)
class _Run:
    """One robot carrying out one instruction within limits."""

    client: RoboPromptClient
    robot: Robot
    task: str
    instruction: str
    allowed: MotionLimits
    how: RunOptions
    asked: Mapping[str, Any]

    def carry_out(self) -> PredictedActions:
        """Carry out the actions after all of them were checked; return the prediction."""
        observation = self.robot.observe()
        self.guard(observation)  # refuse a missing start pose before the service is asked
        finder = ObjectFinder(self.client, self.robot, self.task, observation) if self.how.look_again else None
        predicted = self.client.predict(self.task, self.instruction, observation, **self.asked)
        self.how.preview(predicted.actions, self.allowed, predicted.id)
        check = partial(self._check_all, observation)
        check(predicted.actions)
        if isinstance(self.robot, ChecksPlans):
            self.robot.check_plan(predicted.actions)
        if predicted.actions:
            require_allowed(predicted.findings, self.how.on_danger)
        if finder is None:
            for index, action in enumerate(predicted.actions):
                self.execute(index, action)
            return predicted
        follower = Follower(finder, predicted, observation, check)
        for index in range(len(predicted.actions)):
            self.execute(index, follower.before(index))
            follower.after(index)
        return replace(predicted, actions=follower.actions)

    def guard(self, observation: Observation) -> MotionGuard:
        """For actions that begin where the robot is in `observation`."""
        self.allowed.require_start(observation.end_effector)
        return MotionGuard(self.allowed, int(self.asked.get("max_actions") or MAX_ACTIONS), observation.end_effector)

    def _check_all(self, observation: Observation, actions: Sequence[EndEffectorAction]) -> None:
        guard = self.guard(observation)
        for action in actions:
            guard.check(action)

    def execute(self, index: int, action: EndEffectorAction) -> None:
        """Carry out an action if `confirm` allows it."""
        if self.how.confirm is not None and not self.how.confirm(index, action):
            raise NotConfirmedError(f"action {index + 1} was not allowed")
        self.robot.execute(action)
