"""Questions to a person at the terminal: the plan, leave for each motion, and whether the run worked."""

import sys
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext

from roboprompt_client.answers import Outcome, PlannedStep, PredictedActions
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import Guidable
from roboprompt_client.arms.preview import COLUMNS, Previewed
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.robot import Robot
from roboprompt_client.types.poses import EndEffectorAction, Pose

YES, NO = ("y", "yes"), ("n", "no")


def say(text: str) -> None:
    """Print without buffering."""
    print(text, flush=True)


def in_columns(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of cells as aligned text; the last cell of a row may be longer than its column."""
    listed = list(rows)
    widths = [max(len(row[k]) for row in listed if len(row) > k + 1) for k in range(max(map(len, listed)) - 1)]
    lines = ["  ".join([*(c.ljust(w) for c, w in zip(row[:-1], widths, strict=False)), row[-1]]) for row in listed]
    return "\n".join(line.rstrip() for line in lines)


def plan_table(previewed: Sequence[Previewed]) -> str:
    """Return a plan as a table, with its warnings below."""
    rows = in_columns([COLUMNS, *(item.cells(number) for number, item in enumerate(previewed, 1))])
    warnings = [f"! action {number}: {item.warning}" for number, item in enumerate(previewed, 1) if item.warning]
    return "\n".join([rows, *warnings])


def ask(question: str) -> str | None:
    """Return what the person types, without surrounding spaces; None if standard input has ended."""
    try:
        return input(question).strip()
    except EOFError:
        return None


def ask_yes(question: str) -> bool:
    """Return whether the person types y or yes."""
    return (ask(question) or "").lower() in YES


def guided_by_hand(arm: Arm) -> AbstractContextManager[None]:
    """Return a context in which the arm yields to the person's hand, if it can and the person wants it."""
    yields = isinstance(arm.driver, Guidable) and ask_yes("Shall the arm yield to your hand? Hold it. [y/N] ")
    return arm.guided() if yields else nullcontext()


def recovered(robot: Robot) -> bool:
    """Return whether a stopped arm may move again: a person must say so; raises MotionError if it does not answer."""
    if not isinstance(robot, Arm) or not ask_yes("Has somebody looked at the arm, and may it move again? [y/N] "):
        return False
    robot.recover()
    return True


class Person:
    """The person who answers a run's `preview`, `confirm` and `on_outcome`.

    Args:
        url: of the service that has a page of each prediction.

    Attributes:
        said: the last outcome that the person gave.
    """

    def __init__(self, robot: Robot, url: str = "") -> None:
        self._robot, self._url = robot, url
        self.said: Outcome | None = None
        self._num_actions = 0  # of the present plan

    def preview(self, actions: Sequence[EndEffectorAction], limits: MotionLimits, prediction_id: str) -> None:
        """Print the plan, or that there is no preview, and the address of the prediction's page."""
        if not isinstance(self._robot, Arm):
            _print("no preview: this robot's geometry is unknown (a cell's file would name it)")
        elif previewed := self._robot.preview(actions, limits):
            _print(plan_table(previewed))
        self._num_actions = len(actions)
        _print(f"{self._url}/ui/predictions/{prediction_id}")

    def allow_danger(self, message: str) -> bool:
        """Return whether the person allows what the service calls dangerous."""
        return ask_yes(f"DANGER: {message.rstrip('.')}. Carry out anyway? [y/N] ")

    def confirm_plan(self, index: int, _: EndEffectorAction) -> bool:
        """Return whether the person allows the plan; they are asked before its first action only."""
        return index > 0 or ask_yes(f"Carry out {self._num_actions} action(s)? [y/N] ")

    def confirm(self, index: int, action: EndEffectorAction) -> bool:
        """Return whether the person allows the action."""
        gripper = "open" if action.gripper_open else "closed"
        x_m, y_m, z_m = action.position_m
        return ask_yes(f"action {index + 1}: to {x_m:.3f} {y_m:.3f} {z_m:.3f} m, gripper {gripper}. Go? [y/N] ")

    def confirm_steps(self, steps: Sequence[PlannedStep]) -> bool:
        """Return whether the person allows the steps."""
        _print("\n".join(f"{number}. {step.instruction} ({step.task})" for number, step in enumerate(steps, start=1)))
        return ask_yes("Are these the steps? [y/N] ")

    def confirm_viewpoint(self, number: int, pose: Pose) -> bool:
        """Return whether the person allows the motion to a viewpoint; its problems are printed first."""
        if isinstance(self._robot, Arm) and (problem := self._robot.problem_with(pose)):
            _print(f"! {problem}")
        x_m, y_m, z_m = pose.position_m
        return ask_yes(f"viewpoint {number}: the hand goes to {x_m:.3f} {y_m:.3f} {z_m:.3f} m. Go? [y/N] ")

    def outcome(self, predicted: PredictedActions) -> Outcome | None:
        """Return the outcome that the person types (`y` or `n`, with a note after it), or None if they type nothing."""
        while answer := ask("Did it work? [y, n, or n and why; Enter: not recorded] "):
            word, _, note = answer.partition(" ")
            if word.lower().rstrip(",:") in (*YES, *NO):
                self.said = Outcome(word.lower().rstrip(",:") in YES, note.strip() or None)
                return self.said
        return None


def _print(text: str) -> None:
    print(text, file=sys.stderr)
