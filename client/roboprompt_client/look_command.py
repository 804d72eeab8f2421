"""`roboprompt-robot look` and `label`: what the cell's cameras see, and where an object is in it."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.cell import open_robot, read_cell, write_cell
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.cameras.sight import (
    CAMERA_COLUMNS,
    OBJECT_COLUMNS,
    camera_rows,
    in_columns,
    object_rows,
    take_in,
)
from roboprompt_client.cameras.sight_page import sight_page
from roboprompt_client.cameras.table import Table
from roboprompt_client.cameras.viewpoints import look_around
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import CameraError, InvalidInputError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.labels import label_object, learn_from_labels
from roboprompt_client.robot import Robot
from roboprompt_client.terminal import Person

AddCommand = Callable[[str, str, Callable[[RoboPromptClient, Namespace], int]], ArgumentParser]
CELL = "a cell's JSON file with cameras"
NOT_FOUND = 404


def add_find(parser: ArgumentParser) -> None:
    """Add the option that names what is to be found in pictures."""
    parser.add_argument(
        "--find",
        action="append",
        metavar="OBJECT",
        help="an object to be found in the pictures (may be repeated; default: all that the task knows)",
    )


def add_look(add: AddCommand) -> None:
    """Add `look` and `label` to the script's commands."""
    look = add("look", "show what the cameras see, and where the service finds a task's objects in it", run_look)
    look.add_argument("--robot", required=True, metavar="CELL", help=CELL)
    look.add_argument("--task", help="whose objects are looked for (default: none)")
    add_find(look)
    look.add_argument(
        "--remember", action="store_true", help="keep where the table is: later a bumped camera is refused"
    )
    look.add_argument("--html", type=Path, metavar="FILE", help="write the pictures with the objects drawn in, too")

    label = add("label", "show the service an object by a click in what the cameras see now, or learn it", run_label)
    label.add_argument("--robot", metavar="CELL", help=f"{CELL}; needed with --click unless --episode")
    label.add_argument("--task", required=True, help="the task's name at the service")
    label.add_argument("--object", required=True, help="its name, as instructions call it")
    label.add_argument(
        "--click",
        nargs=3,
        action="append",
        default=[],
        metavar=("CAMERA", "COLUMN", "ROW"),
        help="a pixel of the object; `look --html` says which one the mouse is on (may be repeated, one a camera)",
    )
    label.add_argument("--episode", metavar="ID", help="click in its first pictures instead of new ones")
    label.add_argument("--yaw-deg", type=float, help="where its x axis points, to within ten degrees")
    label.add_argument("--learn", action="store_true", help="learn what it looks like from all its labels")
    label.add_argument(
        "--symmetric", type=_symmetry, default="none", help="none, yaw, or degrees (default: %(default)s)"
    )


def run_look(client: RoboPromptClient, arguments: Namespace) -> int:
    """Print the tables, and write the page; 1 where a camera is in doubt or an object is not found."""
    models = {} if arguments.task is None else _models(client, arguments.task, arguments.find)
    with seeing_arm(arguments.robot) as arm:
        assert arm.cameras is not None
        sight, table = take_in(client, look_around(arm, arm.cameras), models), arm.cameras.table
    _print(in_columns([CAMERA_COLUMNS, *camera_rows(sight)]))
    if models:
        _print("\n" + in_columns([OBJECT_COLUMNS, *object_rows(sight)]))
    doubts = sight.doubts()
    if arguments.remember and not doubts:
        path = Path(arguments.robot)
        write_cell(path, {**read_cell(path), "table": Table.seen_in(sight.frames).to_json()})
        _print(f"the table is kept in {path}")
    elif table is not None:
        doubts += _bumped(table, sight.frames)
    for doubt in doubts:
        _print(f"! {doubt}")
    if arguments.html is not None:
        _write(arguments.html, sight_page(sight))
    return int(bool(doubts) or any(found.pose is None for found in sight.objects))


def _bumped(table: Table, frames: Sequence[RgbdFrame]) -> list[str]:
    """What the table says of each camera."""
    found = []
    for frame in frames:
        try:
            table.check([frame])
        except CameraError as error:
            found.append(str(error))
    return found


def run_label(client: RoboPromptClient, arguments: Namespace) -> int:
    """Send a label, learn, or both."""
    if not arguments.click and not arguments.learn:
        raise InvalidInputError("--click", "and --learn are missing", "one of them, or both")
    client.ping()
    if arguments.click:
        clicks = {camera: (_pixel(column), _pixel(row)) for camera, column, row in arguments.click}
        what = {"episode_id": arguments.episode, "yaw_deg": arguments.yaw_deg}
        frames = () if arguments.episode else _pictures(arguments.robot)
        if not arguments.episode:
            _make_task(client, arguments.task)
        label = label_object(client, arguments.task, arguments.object, clicks, frames=frames, **what)
        masks = ", ".join(f"{camera['name']} {camera['num_pixels']}" for camera in label["cameras"])
        _print(f"labeled as {label['id']}: pixels by camera: {masks}")
    if arguments.learn:
        learned = learn_from_labels(client, arguments.task, arguments.object, arguments.symmetric)
        model = learned["model"]
        _print(f"learned from {len(model['views'])} views {learned['advice']}".rstrip())
        for left_out in model.get("left_out", ()):
            _print(f"! left out: {left_out}")
    return 0


def seeing_arm(cell: str | None) -> Arm:
    """The arm of a cell's file with cameras; a person is asked before it moves to a viewpoint.

    Raises:
        InvalidInputError: if the cell has no cameras.
    """
    if cell is None:
        raise InvalidInputError("--robot", "is missing", CELL)
    robot = open_robot(cell)
    if not isinstance(robot, Arm) or robot.cameras is None:
        raise InvalidInputError("--robot", f"{cell} has no cameras", CELL)
    robot.confirm_viewpoint = Person(robot).confirm_viewpoint
    return robot


def find_in_pictures(robot: Robot, client: RoboPromptClient, task: str | None, find: Sequence[str] | None) -> None:
    """Let the pictures of a cell's cameras show the objects that are named, or those that the task knows.

    Raises:
        InvalidInputError: if none is named, and no task is or the service does not answer.
        ServiceProblemError: if it refuses.
    """
    if not isinstance(robot, Arm) or robot.cameras is None:
        return
    if find:
        robot.to_find = tuple(find)
        return
    if task is None:
        raise InvalidInputError("--find", "is left out beside --task", "the names of the objects in view")
    try:
        robot.to_find = tuple(_models(client, task, None))
    except ServiceUnreachableError as error:
        raise InvalidInputError("--find", f"is missing, and {error}", "the names of the objects in view") from error


def _models(client: RoboPromptClient, task: str, names: Sequence[str] | None) -> Mapping[str, Any]:
    """What the task knows of its objects, by name; of a task that is not there nothing."""
    try:
        known: Mapping[str, Any] = client.get(f"/tasks/{task}").get("object_models") or {}
    except ServiceProblemError as error:
        if error.status != NOT_FOUND:
            raise
        known = {}
    if names is None:
        return known
    if missing := [name for name in names if name not in known]:
        remedy = f"one of {', '.join(known) or 'none yet'}; `roboprompt-robot label` shows it to the service"
        raise InvalidInputError("--find", f"{missing[0]!r} is not known to the task {task!r}", remedy)
    return {name: known[name] for name in names}


def _make_task(client: RoboPromptClient, task: str) -> None:
    """A task with this name, where there is none: labels belong to one."""
    try:
        client.get(f"/tasks/{task}")
    except ServiceProblemError as error:
        if error.status != NOT_FOUND:
            raise
        client.configure_task(task)


def _pictures(cell: str | None) -> tuple[Any, ...]:
    with seeing_arm(cell) as arm:
        assert arm.cameras is not None
        return look_around(arm, arm.cameras)


def _pixel(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidInputError("--click", f"has {text!r}", "CAMERA COLUMN ROW, as `front 312 205`") from error


def _symmetry(text: str) -> str | float:
    return text if text in ("none", "yaw") else float(text)


def _write(path: Path, page: str) -> None:
    try:
        path.write_text(page)
    except OSError as error:
        raise InvalidInputError("--html", f"{path} cannot be written: {error}", "a file") from error


def _print(text: str) -> None:
    print(text, flush=True)  # noqa: T201
