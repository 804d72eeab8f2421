"""`roboprompt-robot look`, `label` and `viewpoints`: what the cell's cameras see, and from where."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from roboprompt_client.arms.arm import Arm
from roboprompt_client.cameras.sight import Sight, sight_page
from roboprompt_client.cameras.table import Table
from roboprompt_client.cell import MAX_VIEWPOINTS, closing_robot, open_robot, read_cell, write_cell
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.terminal import Person, ask, in_columns, led_by_hand, say
from roboprompt_client.errors import CameraError, InvalidInputError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.robot import Robot
from roboprompt_client.types.camera import RgbdFrame

AddCommand = Callable[[str, str, Callable[[RoboPromptClient, Namespace], int]], ArgumentParser]
CELL = "a cell's JSON file with cameras"
NOT_FOUND = 404
KEEP = "Guide the hand to a pose from which its camera sees the objects. Enter: keep it as viewpoint {}, q: done "


def add_find(parser: ArgumentParser) -> None:
    """Add the option that names the objects to find in pictures."""
    what = "an object to find in the pictures (may be repeated; default: all that the task knows)"
    parser.add_argument("--find", action="append", metavar="OBJECT", help=what)


def add_look(add: AddCommand) -> None:
    """Add `look`, `label` and `viewpoints` to the commands."""
    look = add("look", "show what the cameras see, and where the service finds a task's objects", run_look)
    look.add_argument("--robot", required=True, metavar="CELL", help=CELL)
    look.add_argument("--task", help="find this task's objects (default: none)")
    add_find(look)
    what = "remember where the table is, so that a camera that was bumped is noticed later"
    look.add_argument("--remember", action="store_true", help=what)
    look.add_argument(
        "--html", type=Path, metavar="FILE", help="also write a page of the pictures with the objects drawn in"
    )

    label = add("label", "label an object by a click in the cameras' pictures, or learn it from its labels", run_label)
    label.add_argument("--robot", metavar="CELL", help=f"{CELL}; needed with --click, unless --episode is given")
    label.add_argument("--task", required=True, help="the task's name at the service")
    label.add_argument("--object", required=True, help="its name in instructions")
    what = "a pixel of the object; a click in the page of `look --html` shows it (may be repeated, once a camera)"
    pixel = ("CAMERA", "COLUMN", "ROW")
    label.add_argument("--click", nargs=3, action="append", default=[], metavar=pixel, help=what)
    label.add_argument("--episode", metavar="ID", help="label its first pictures instead of new ones")
    label.add_argument("--yaw-deg", type=float, help="direction of its x axis, to within ten degrees")
    label.add_argument("--learn", action="store_true", help="let the service learn the object from all its labels")
    turns = "none, yaw (looks the same all around), or the angle after which it looks the same (default: %(default)s)"
    label.add_argument("--symmetric", type=_symmetry, default="none", help=turns)

    what = "teach poses from which a camera in the hand looks at the scene"
    viewpoints = add("viewpoints", what, run_viewpoints)
    viewpoints.add_argument("--robot", required=True, metavar="CELL", help=CELL)


def run_look(client: RoboPromptClient, arguments: Namespace) -> int:
    """Print the tables, and write the page; return 1 if a camera seems wrong or an object is not found."""
    models = {} if arguments.task is None else _models(client, arguments.task, arguments.find)
    with seeing_arm(arguments.robot) as arm:
        assert arm.cameras is not None
        sight, table = Sight.of(client, arm.look_around(), models), arm.cameras.table
    say(in_columns(sight.camera_rows()))
    if models:
        say("\n" + in_columns(sight.object_rows()))
    doubts = sight.doubts()
    if arguments.remember and not doubts:
        path = Path(arguments.robot)
        write_cell(path, {**read_cell(path), "table": Table.seen_in(sight.frames).to_json()})
        say(f"the table's place is written to {path}")
    elif table is not None:
        doubts += _bumped(table, sight.frames)
    for doubt in doubts:
        say(f"! {doubt}")
    if arguments.html is not None:
        try:
            arguments.html.write_text(sight_page(sight))
        except OSError as error:
            raise InvalidInputError("--html", f"{arguments.html} cannot be written: {error}", "a file") from error
    return int(bool(doubts) or any(found.pose is None for found in sight.objects))


def _bumped(table: Table, frames: Sequence[RgbdFrame]) -> list[str]:
    """Return an error for each camera that sees the table at another place."""
    found = []
    for frame in frames:
        try:
            table.check([frame])
        except CameraError as error:
            found.append(str(error))
    return found


def run_label(client: RoboPromptClient, arguments: Namespace) -> int:
    """Send a label, or learn the object, or both."""
    if not arguments.click and not arguments.learn:
        raise InvalidInputError("--click", "and --learn are missing", "one of them, or both")
    client.ping()
    if arguments.click:
        _label(client, arguments)
    if arguments.learn:
        learned = client.learn_from_labels(arguments.task, arguments.object, arguments.symmetric)
        model = learned["model"]
        say(f"learned from {len(model['views'])} views {learned['advice']}".rstrip())
        for left_out in model.get("left_out", ()):
            say(f"! left out: {left_out}")
    return 0


def _label(client: RoboPromptClient, arguments: Namespace) -> None:
    clicks = {camera: [_pixel(column), _pixel(row)] for camera, column, row in arguments.click}
    frames: tuple[RgbdFrame, ...] = ()
    if not arguments.episode:
        with seeing_arm(arguments.robot) as arm:
            frames = arm.look_around()
        if _task(client, arguments.task) is None:  # labels belong to one
            client.configure_task(arguments.task)
    what = {"clicks": clicks, "yaw_deg": arguments.yaw_deg}
    label = client.label_object(arguments.task, arguments.object, arguments.episode, frames, **what)
    masks = ", ".join(f"{camera['name']} {camera['num_pixels']}" for camera in label["cameras"])
    say(f"labeled as {label['id']}: pixels by camera: {masks}")


def run_viewpoints(_: RoboPromptClient, arguments: Namespace) -> int:
    """Write the poses to which the person guides the hand into the cell's file; return 1 if there are none."""
    path = Path(arguments.robot)
    with seeing_arm(arguments.robot) as arm:
        assert arm.cameras is not None
        if not any(camera.in_hand for camera in arm.cameras.cameras):
            raise InvalidInputError("cameras", "the hand carries none", "a camera with camera_to_hand")
        with led_by_hand(arm):
            kept = _viewpoints(arm)
    if not kept:
        return 1
    write_cell(path, {**read_cell(path), "viewpoints": kept})
    say(f"written to {path}; next: roboprompt-robot look --robot {path}")
    return 0


def _viewpoints(arm: Arm) -> list[dict[str, Any]]:
    kept: list[dict[str, Any]] = []
    while len(kept) < MAX_VIEWPOINTS and ask(KEEP.format(len(kept) + 1)) not in ("q", None):
        state = arm.state()
        place, turn = state.position_m.round(4).tolist(), state.quaternion_xyzw.tolist()
        kept.append({"position": place, "quaternion_xyzw": turn})
        say(f"  {place} m")
    return kept


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
        robot.to_find = tuple(_models(client, task, None))
    except ServiceUnreachableError as error:
        raise InvalidInputError("--find", f"is missing, and {error}", "the names of the objects in view") from error


def _models(client: RoboPromptClient, task: str, names: Sequence[str] | None) -> Mapping[str, Any]:
    """Return the object models of a task by name; empty if there is no such task."""
    known: Mapping[str, Any] = (_task(client, task) or {}).get("object_models") or {}
    if names is None:
        return known
    if missing := [name for name in names if name not in known]:
        remedy = f"one of {', '.join(known) or 'none yet'}; `roboprompt-robot label` shows it to the service"
        raise InvalidInputError("--find", f"{missing[0]!r} is not known to the task {task!r}", remedy)
    return {name: known[name] for name in names}


def _task(client: RoboPromptClient, task: str) -> dict[str, Any] | None:
    """Return the task's document, or None if there is no task of this name."""
    try:
        return client.get(f"/tasks/{task}")
    except ServiceProblemError as error:
        if error.status != NOT_FOUND:
            raise
        return None


def _pixel(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidInputError("--click", f"has {text!r}", "CAMERA COLUMN ROW, such as `front 312 205`") from error


def _symmetry(text: str) -> str | float:
    return text if text in ("none", "yaw") else float(text)
