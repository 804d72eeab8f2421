"""What the commands share: their options, the robot that they open, and what it looks for in pictures."""

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from roboprompt_client.arms.arm import Arm
from roboprompt_client.cell import closing_robot, open_robot
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.terminal import Person
from roboprompt_client.errors import InvalidInputError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.robot import OBJECTS, Robot
from roboprompt_client.types import quaternions

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


def add_find(parser: ArgumentParser) -> None:
    """Add the option that names the objects to find in pictures."""
    parser.add_argument("--find", action="append", metavar="OBJECT", help=FIND)


@contextmanager
def asking_robot(name: str, *, asks: bool = True) -> Iterator[Robot]:
    """Open a robot as `open_robot` does, and close it at the end; if it `asks`, an arm does before each viewpoint."""
    with closing_robot(open_robot(name)) as robot:
        if asks and isinstance(robot, Arm):
            robot.confirm_viewpoint = Person(robot).confirm_viewpoint
        yield robot


@contextmanager
def seeing_arm(cell: str | None) -> Iterator[Arm]:
    """Open the arm of a cell's file as `asking_robot` does; raises InvalidInputError if the cell has no cameras."""
    if cell is None:
        raise InvalidInputError("--robot", "is missing", CELL)
    with asking_robot(cell) as robot:
        if not isinstance(robot, Arm) or robot.cameras is None:
            raise InvalidInputError("--robot", f"{cell} has no cameras", CELL)
        yield robot


def find_in_pictures(robot: Robot, client: RoboPromptClient, task: str | None, find: Sequence[str] | None) -> None:
    """Set which objects are to be found in the cameras' pictures: those in `find`, else those that the task knows.

    Raises:
        InvalidInputError: if neither objects nor a task are named, or the service does not answer.
        ServiceProblemError: if it refuses.
    """
    if not isinstance(robot, Arm) or robot.cameras is None:
        return
    if find:
        robot.to_find = tuple(find)
        return
    if task is None:
        raise InvalidInputError("--find", "is missing, and so is --task", "the names of the objects in view")
    try:
        robot.to_find = tuple(models_of(client, task))
    except ServiceUnreachableError as error:
        raise InvalidInputError("--find", f"is missing, and {error}", "the names of the objects in view") from error


def other_base(robot: Robot, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the base of the cell's arm as a task's settings; empty if the settings have it there, or it is not known.

    Args:
        settings: of a task; what they lack is as for a new task.
    """
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
    """Refuse a task that has the arm's base elsewhere than the cell, as "left" and "nearest" depend on it.

    Args:
        settings: the task's document; None: there is no such task.

    Raises:
        InvalidInputError: if the base is elsewhere, or turned otherwise.
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
