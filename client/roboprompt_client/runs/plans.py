"""Carry out a sentence over several tasks step by step; the first failure ends it."""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from roboprompt_client.answers import PlannedStep, PredictedActions
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import NotConfirmedError, StepFailedError
from roboprompt_client.robot import Observation, Robot, stop_after_error
from roboprompt_client.runs.loop import OnOutcome, record_outcome, run_task
from roboprompt_client.types.poses import EndEffectorAction

ConfirmSteps = Callable[[Sequence[PlannedStep]], bool]
log = logging.getLogger(__name__)


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
        on_outcome: called after each step; the plan goes on only if it returns a success. None: a step whose actions
            were carried out counts as done.
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

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        """Return what the robot offers besides the Protocol's methods, such as `check_plan`."""
        return getattr(self.robot, name)

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
