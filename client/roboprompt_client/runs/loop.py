"""Observe, ask, act: the loop of a robot that uses the service."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from roboprompt_client.answers import (
    Confirm,
    Finding,
    OnDanger,
    Outcome,
    PredictedActions,
    checked_on_danger,
    require_allowed,
)
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import (
    InvalidAnswerError,
    InvalidInputError,
    NotConfirmedError,
    ServiceProblemError,
    ServiceUnreachableError,
)
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MAX_ACTIONS, MotionLimits
from roboprompt_client.robot import Observation, Robot
from roboprompt_client.runs.leading import Leading
from roboprompt_client.runs.look_again import Follower, ObjectFinder
from roboprompt_client.types.poses import EndEffectorAction

Preview = Callable[[Sequence[EndEffectorAction], MotionLimits], None]
OnOutcome = Callable[[PredictedActions], Outcome | None]
CarryingOut = Callable[[int, EndEffectorAction, str | None], AbstractContextManager[None]]
Watch = Callable[[str, str], AbstractContextManager[CarryingOut]]
log = logging.getLogger(__name__)


def watch_nothing(task: str, instruction: str) -> AbstractContextManager[CarryingOut]:
    """A watch for a robot that is not watched."""
    return nullcontext(lambda *_: nullcontext())


def show_nothing(actions: Sequence[EndEffectorAction], limits: MotionLimits) -> None:
    """A preview for a loop without a person."""


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
    watch: Watch = watch_nothing,
    on_outcome: OnOutcome | None = None,
    **options: Any,  # noqa: ANN401
) -> PredictedActions:
    """Let the robot carry out one instruction; returns what was predicted.

    Whatever goes wrong, Ctrl-C included, the robot is stopped where it is before the error goes on.

    Args:
        limits: what the robot may do, whatever the service says; None: what the service says of the task.
        pinned: bounds of the robot's own that hold as well: the service cannot widen them.
        confirm: asked before each action, with its index; the run ends where it says no.
        stream: begin to move while the LLM still writes; otherwise nothing moves until the whole reply is known to be
            a list of actions within the limits.
        look_again: observe again before contact (the module `look_again` says when) and move the remaining actions
            along with the objects that they refer to; what is returned has the actions as they were carried out. Not
            together with `stream`.
        leading: with `look_again`: aims ahead of objects that move by themselves (the module `leading`).
        on_danger: where the service finds its own answer dangerous: ask `confirm` before anything moves, refuse, or go
            ahead. None: `confirm` where there is one, else `refuse`. With `stream` this holds for what is
            found ahead of the first action.
        preview: shown the actions and the limits that hold, before the actions are checked and before anything moves;
            with `stream` each action as it comes.
        watch: around the run; what it gives is around the motion of each action, with its index and the prediction's
            id, if it is known. `partial(Live, client, robot)` lets people watch and stop the robot at the service.
        on_outcome: called with what was carried out; what it returns is recorded at the service. A failure to record
            it is logged.
        options: as for `RoboPromptClient.predict`.

    Raises:
        InvalidInputError: if arguments do not fit each other, the limits cannot be held (NaN, say) or leave no room
            within the pinned ones, or if steps are bounded and the observation lacks `end_effector`; nothing was moved.
        ServiceProblemError, ServiceUnreachableError: without `stream` nothing was moved.
        InvalidAnswerError: if the findings are missing or not well formed; nothing was moved.
        UnsafeActionError: if an action is beyond the limits; it was not carried out, and without `stream` none was.
        MotionError: if an action could not be carried out.
        NotConfirmedError: if `confirm` said no.
        DangerError: if the answer is dangerous and `on_danger` refuses it; nothing was moved.
        ObjectLostError: if an object that is looked for again is not seen; with `leading` also if it has left what
            carried it, or moves too fast.
    """
    try:
        danger = checked_on_danger(on_danger, confirm)
        if leading is not None and not look_again:
            raise InvalidInputError("leading", "is given, but the robot does not look again", "look_again=True")
        if look_again and stream:
            message = "is asked for together with stream, which moves before all actions are known"
            raise InvalidInputError("look_again", message, "one of both")
        if look_again:
            _require_still_cameras(robot, "look_again")
        allowed = _allowed(client, task, limits, pinned)
        with watch(task, instruction) as carrying_out:
            run = _Run(client, robot, task, instruction, allowed, danger, confirm, preview, carrying_out, options)
            predicted = run.streamed() if stream else run.whole(look_again, leading)
    except BaseException:
        robot.stop()
        raise
    if on_outcome is not None and predicted.actions and (outcome := on_outcome(predicted)) is not None:
        try:
            client.record_outcome(predicted.id, *outcome)
        except (ServiceProblemError, ServiceUnreachableError) as error:  # the task is done all the same
            log.warning("the outcome was not recorded: %s", error)
    return predicted


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
    watch: Watch = watch_nothing,
    **options: Any,  # noqa: ANN401
) -> Iterator[PredictedActions]:
    """Observe, ask for one action, carry it out, and again, until the LLM says that it is done.

    What is not listed is as for `run_task`, at each step.

    Args:
        max_steps: after so many the run ends, done or not.

    Yields:
        the answer to each step, before its findings are looked at and its action is carried out; the last has no action
        unless `max_steps` ended the run.

    Raises:
        RoboPromptError: as `run_task`; the robot is stopped before.
    """
    asked = {**options, "closed_loop": True}
    guard: MotionGuard | None = None
    try:
        danger = checked_on_danger(on_danger, confirm)
        _require_still_cameras(robot, "closed_loop")
        allowed = _allowed(client, task, limits, pinned)
        with watch(task, instruction) as carrying_out:
            run = _Run(client, robot, task, instruction, allowed, danger, confirm, preview, carrying_out, options)
            for index in range(max_steps):
                observation = robot.observe()
                guard = guard or run.guard(observation, max_steps)
                predicted = client.predict(task, instruction, observation, **asked)
                preview(predicted.actions, allowed)
                for action in predicted.actions:
                    guard.check(action)
                yield predicted
                if not predicted.actions:
                    return
                run.require_allowed(predicted.findings, predicted.actions)
                run.execute(index, predicted.actions[0], predicted.id)
                asked["after"] = predicted.id
    except BaseException:
        robot.stop()
        raise


@dataclass(frozen=True)
class _Run:
    """One robot that carries out one instruction within the limits that hold."""

    client: RoboPromptClient
    robot: Robot
    task: str
    instruction: str
    allowed: MotionLimits
    on_danger: OnDanger
    confirm: Confirm | None
    preview: Preview
    carrying_out: CarryingOut
    options: Mapping[str, Any]

    def whole(self, look_again: bool, leading: Leading | None) -> PredictedActions:
        """Nothing moves before all actions are known to be allowed."""
        looked_s = 0.0 if leading is None else leading.clock()
        observation = self.robot.observe()
        self.guard(observation)  # refuses a start that is not known before the service is asked
        finder = ObjectFinder(self.client, self.robot, self.task, observation) if look_again else None
        predicted = self.client.predict(self.task, self.instruction, observation, **self.options)
        self.preview(predicted.actions, self.allowed)
        check = partial(self._check_all, observation)
        check(predicted.actions)
        self.require_allowed(predicted.findings, predicted.actions)
        if finder is None:
            for index, action in enumerate(predicted.actions):
                self.execute(index, action, predicted.id)
            return predicted
        if leading is not None:
            leading.saw({pose.name: pose for pose in observation.objects or predicted.objects}, looked_s)
        follower = Follower(finder, predicted, observation, check, leading=leading)
        for index in range(len(predicted.actions)):
            self.execute(index, follower.before(index), predicted.id)
            follower.after(index)
        return replace(predicted, actions=follower.actions)

    def streamed(self) -> PredictedActions:
        """Each action is carried out as it comes."""
        observation = self.robot.observe()
        guard = self.guard(observation)
        findings: list[Sequence[Finding]] = []  # of the event ahead of the first action
        for index, item in enumerate(
            self.client.stream(self.task, self.instruction, observation, on_findings=findings.append, **self.options)
        ):
            if isinstance(item, PredictedActions):
                return item
            self.preview((item,), self.allowed)
            guard.check(item)
            if not findings:
                raise InvalidAnswerError("findings", "did not come before the first action", "a first event `findings`")
            if index == 0:
                self.require_allowed(findings[0], (item,))
            self.execute(index, item)
        raise AssertionError("a stream ends with the whole answer or an error")

    def guard(self, observation: Observation, max_actions: int | None = None) -> MotionGuard:
        """For actions that begin where the robot is in `observation`."""
        self.allowed.require_start(observation.end_effector)
        most = self.options.get("max_actions", MAX_ACTIONS) if max_actions is None else max_actions
        return MotionGuard(self.allowed, int(most), observation.end_effector)

    def _check_all(self, observation: Observation, actions: Sequence[EndEffectorAction]) -> None:
        guard = self.guard(observation)
        for action in actions:
            guard.check(action)

    def require_allowed(self, findings: Sequence[Finding], actions: Sequence[EndEffectorAction]) -> None:
        """Raise DangerError or NotConfirmedError for a danger that is not allowed."""
        require_allowed(findings, actions, self.on_danger, self.confirm)

    def execute(self, index: int, action: EndEffectorAction, prediction_id: str | None = None) -> None:
        """Move, if `confirm` lets the action go."""
        if self.confirm is not None and not self.confirm(index, action):
            raise NotConfirmedError(f"action {index + 1} was not allowed")
        with self.carrying_out(index, action, prediction_id):
            self.robot.execute(action)


def _require_still_cameras(robot: Robot, mode: str) -> None:
    """Refuse a robot whose hand would leave what it does in order to look."""
    if getattr(robot, "viewpoints", ()):
        message = "is asked of an arm that goes to viewpoints to look, away from what it does"
        raise InvalidInputError(mode, message, "cameras that need no viewpoints")


def _allowed(
    client: RoboPromptClient, task: str, limits: MotionLimits | None, pinned: MotionLimits | None
) -> MotionLimits:
    of_task = limits or client.motion_limits(task)
    return of_task if pinned is None else of_task.intersection(pinned)
