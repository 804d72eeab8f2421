"""What the commands share: options, what a robot looks for in pictures, and questions to the person."""

import math
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from roboprompt_client.answers import Outcome, PlannedStep, PredictedActions
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.preview import COLUMNS, Previewed
from roboprompt_client.cell import closing_robot, open_robot
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.robot import OBJECTS, Robot
from roboprompt_client.types import quaternions
from roboprompt_client.types.poses import EndEffectorAction

Command = Callable[[RoboPromptClient, Namespace], int]
AddCommand = Callable[[str, str, Command], ArgumentParser]
CELL = "a cell's JSON file with cameras"
ROBOT = (
    "a cell's JSON file, or MODULE:FACTORY: a callable that returns a Robot; modules in the current folder are found"
)
SEEN = f"the objects' poses, {OBJECTS}"
FIND = "an object to find in the pictures (may be repeated; default: all that the task knows)"
NOT_FOUND = 404
SAME_BASE_M, SAME_BASE_RAD = 0.05, math.radians(10.0)  # between the arm's base in the cell's file and in a task
DEFAULT_BASE: Mapping[str, Any] = {"robot_base": (0.0, 0.0, 0.0), "robot_base_yaw_deg": 0.0}  # of a new task
MAX_TILT_RAD = math.radians(45.0)  # an arm that hangs from a wall has no direction in which it looks
YES, NO = ("y", "yes"), ("n", "no")


def add_find(parser: ArgumentParser) -> None:
    """Add the option that names the objects to find in pictures."""
    parser.add_argument("--find", action="append", metavar="OBJECT", help=FIND)


@contextmanager
def seeing_arm(cell: str) -> Iterator[Arm]:
    """Open the arm of a cell's file, and close it at the end; raises InvalidInputError if the cell has no cameras."""
    with closing_robot(open_robot(cell)) as robot:
        if not isinstance(robot, Arm) or not robot.cameras.cameras:
            raise InvalidInputError("--robot", f"{cell} has no cameras", CELL)
        yield robot


def find_in_pictures(robot: Robot, client: RoboPromptClient, task: str | None, find: Sequence[str] | None) -> None:
    """Set which objects are to be found in the cameras' pictures: those in `find`, else those that the task knows.

    Raises InvalidInputError if neither objects nor a task are named, or the service does not answer.
    """
    if not isinstance(robot, Arm) or not robot.cameras.cameras:
        return
    valid = "the names of the objects in view"
    if find is None and task is None:
        raise InvalidInputError("--find", "is missing, and so is --task", valid)
    try:
        robot.to_find = tuple(find or models_of(client, str(task)))
    except ServiceUnreachableError as error:
        raise InvalidInputError("--find", f"is missing, and {error}", valid) from error


def other_base(robot: Robot, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the base of the cell's arm as a task's settings; empty if these have it there, or it is not known."""
    if not isinstance(robot, Arm) or quaternions.tilt_rad(robot.calibration.quaternion_xyzw) > MAX_TILT_RAD:
        return {}
    known = {**DEFAULT_BASE, **settings}
    position_m, yaw_rad = robot.calibration.position_m, quaternions.yaw_rad(robot.calibration.quaternion_xyzw)
    away_m = math.dist(position_m[:2], known["robot_base"][:2])
    turned_rad = abs(math.remainder(yaw_rad - math.radians(known["robot_base_yaw_deg"]), math.tau))
    if away_m <= SAME_BASE_M and turned_rad <= SAME_BASE_RAD:
        return {}
    return {"robot_base": position_m.round(4).tolist(), "robot_base_yaw_deg": round(math.degrees(yaw_rad), 1)}


def require_same_base(robot: Robot, task: str, settings: Mapping[str, Any] | None) -> None:
    """Raise InvalidInputError if a task (None: there is none) has the arm's base elsewhere than the cell.

    "left" and "nearest" depend on it.
    """
    if settings is not None and (base := other_base(robot, settings)):
        has = {name: settings.get(name, DEFAULT_BASE[name]) for name in base}
        valid = "the same in both: correct the cell's file, or the task on its page"
        raise InvalidInputError("base_to_world", f"says {base}, but task {task!r} has {has}", valid)


def models_of(client: RoboPromptClient, task: str) -> Mapping[str, Any]:
    """Return the object models of a task by name; empty if there is no such task."""
    return (task_document(client, task) or {}).get("object_models") or {}


def task_document(client: RoboPromptClient, task: str) -> dict[str, Any] | None:
    """Return the task's document, or None if there is no task of this name."""
    try:
        return client.get(f"/tasks/{task}")
    except ServiceProblemError as error:
        if error.status != NOT_FOUND:
            raise
        return None


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


def recovered(robot: Robot) -> bool:
    """Return whether a stopped arm may move again: a person must say so; raises MotionError if it does not answer."""
    if not isinstance(robot, Arm) or not ask_yes("Has somebody looked at the arm, and may it move again? [y/N] "):
        return False
    robot.recover()
    return True


class Person:
    """The person who answers a run's `preview`, `on_danger`, `confirm` and `on_outcome`; `said` is the last outcome."""

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

    def outcome(self, predicted: PredictedActions) -> Outcome | None:
        """Return the outcome that the person types (`y` or `n`, with a note after it), or None if they type nothing."""
        while answer := ask("Did it work? [y, n, or n and why; Enter: not recorded] "):
            word, _, note = answer.partition(" ")
            if (word := word.lower().rstrip(",:")) in (*YES, *NO):
                self.said = Outcome(word in YES, note.strip() or None)
                return self.said
        return None


def _print(text: str) -> None:
    print(text, file=sys.stderr)
