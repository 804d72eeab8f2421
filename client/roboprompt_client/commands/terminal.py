"""A person at the terminal, who sees the plan, is asked before each motion, and says afterwards whether it worked."""

import sys
from collections.abc import Iterable, Sequence

from roboprompt_client.answers import Outcome, PlannedStep, PredictedActions
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.preview import COLUMNS, Previewed
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.robot import Robot
from roboprompt_client.types.poses import EndEffectorAction, Pose

YES, NO = ("y", "yes"), ("n", "no")


def say(text: str) -> None:
    """Print at once."""
    print(text, flush=True)


def in_columns(rows: Iterable[Sequence[str]]) -> str:
    """Rows of cells for a terminal; the last cell of a row may be longer than its column."""
    listed = list(rows)
    widths = [max(len(row[k]) for row in listed if len(row) > k + 1) for k in range(max(map(len, listed)) - 1)]
    lines = ["  ".join([*(c.ljust(w) for c, w in zip(row[:-1], widths, strict=False)), row[-1]]) for row in listed]
    return "\n".join(line.rstrip() for line in lines)


def plan_table(previewed: Sequence[Previewed]) -> str:
    """A plan, its warnings below it."""
    rows = in_columns([COLUMNS, *(item.cells(number) for number, item in enumerate(previewed, 1))])
    warnings = [f"! action {number}: {item.warning}" for number, item in enumerate(previewed, 1) if item.warning]
    return "\n".join([rows, *warnings])


def ask(question: str) -> str | None:
    """What a person types, without surrounding spaces; None where standard input has ended."""
    try:
        return input(question).strip()
    except EOFError:
        return None


def ask_yes(question: str) -> bool:
    """Whether a person types yes."""
    return (ask(question) or "").lower() in YES


class Person:
    """What the loop calls `preview`, `confirm` and `on_outcome`.

    Attributes:
        said: the outcome of the last run that the person gave one for.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.said: Outcome | None = None
        self._shown: list[Previewed] = []  # in the order in which `confirm` is asked about them

    def preview(self, actions: Sequence[EndEffectorAction], limits: MotionLimits) -> None:
        """Print the plan, or that the arm's geometry is unknown."""
        if not isinstance(self._robot, Arm):
            _print("no preview: the geometry of this robot's arm is unknown (a cell's file names it)")
            return
        previewed = self._robot.preview(actions, limits)
        self._shown += previewed
        if previewed:
            _print(plan_table(previewed))

    def confirm(self, index: int, action: EndEffectorAction) -> bool:
        """Whether the person lets the action go; what is wrong with it is printed first."""
        if index < len(self._shown) and (warning := self._shown[index].warning):
            _print(f"! {warning}")
        gripper = "open" if action.gripper_open else "closed"
        x_m, y_m, z_m = action.position_m
        return ask_yes(f"action {index + 1}: to {x_m:.3f} {y_m:.3f} {z_m:.3f} m, gripper {gripper}. Go? [y/N] ")

    def confirm_steps(self, steps: Sequence[PlannedStep]) -> bool:
        """Whether the person lets the plan begin."""
        _print("\n".join(f"{number}. {step.instruction} ({step.task})" for number, step in enumerate(steps, start=1)))
        return ask_yes("Are these the steps? [y/N] ")

    def confirm_viewpoint(self, number: int, pose: Pose) -> bool:
        """Whether the person lets the hand go to a viewpoint; what is wrong with the way is printed first."""
        if isinstance(self._robot, Arm) and (problem := self._robot.problem_with(pose)):
            _print(f"! {problem}")
        x_m, y_m, z_m = pose.position_m
        return ask_yes(f"viewpoint {number}: the hand goes to {x_m:.3f} {y_m:.3f} {z_m:.3f} m. Go? [y/N] ")

    def outcome(self, predicted: PredictedActions) -> Outcome | None:
        """What the person says: `y` or `n`, with a note behind it; None where they answer nothing."""
        self._shown.clear()  # the next plan counts its actions anew
        while answer := ask("Did it work? [y, n, or n and why; Enter: not recorded] "):
            word, _, note = answer.partition(" ")
            if word.lower().rstrip(",:") in (*YES, *NO):
                self.said = Outcome(word.lower().rstrip(",:") in YES, note.strip() or None)
                return self.said
        return None


def _print(text: str) -> None:
    print(text, file=sys.stderr)
