"""`roboprompt-robot look`, `label` and `viewpoints`: what the cell's cameras see, and from where."""

from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from roboprompt_client.arms.arm import Arm
from roboprompt_client.cameras.sight import Sight, sight_page
from roboprompt_client.cameras.table import Table
from roboprompt_client.cell import MAX_VIEWPOINTS, read_cell, write_cell
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.shared import CELL, AddCommand, add_find, models_of, seeing_arm, task_document
from roboprompt_client.commands.terminal import ask, guided_by_hand, in_columns, say
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.types.camera import RgbdFrame

KEEP = "Guide the hand to a pose from which its camera sees the objects. Enter: keep it as viewpoint {}, q: done "
CLICK = "a pixel of the object; a click in the page of `look --html` shows it (may be repeated, once a camera)"
TURNS = "none, yaw (looks the same all around), or the angle after which it looks the same (default: %(default)s)"


def add_look(add: AddCommand) -> None:
    """Add `look`, `label` and `viewpoints` to the commands."""
    look = add("look", "show what the cameras see, and where the service finds a task's objects", run_look)
    look.add_argument("--robot", required=True, metavar="CELL", help=CELL)
    look.add_argument("--task", help="find this task's objects (default: none)")
    add_find(look)
    look.add_argument("--remember", action="store_true", help="write the table's place into the cell's file")
    look.add_argument("--html", type=Path, metavar="FILE", help="also write a page of the pictures with the objects")

    label = add("label", "label an object by a click in the cameras' pictures, or learn it from its labels", run_label)
    label.add_argument("--robot", metavar="CELL", help=f"{CELL}; needed with --click, unless --episode is given")
    label.add_argument("--task", required=True, help="the task's name at the service")
    label.add_argument("--object", required=True, help="its name in instructions")
    pixel = ("CAMERA", "COLUMN", "ROW")
    label.add_argument("--click", nargs=3, action="append", default=[], metavar=pixel, help=CLICK)
    label.add_argument("--episode", metavar="ID", help="label its first pictures instead of new ones")
    label.add_argument("--yaw-deg", type=float, help="direction of its x axis, to within ten degrees")
    label.add_argument("--learn", action="store_true", help="let the service learn the object from all its labels")
    label.add_argument("--symmetric", type=_symmetry, default="none", help=TURNS)

    viewpoints = add("viewpoints", "teach poses from which a camera in the hand sees the scene", run_viewpoints)
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
        doubts += [doubt for frame in sight.frames if (doubt := _bumped(table, frame))]
    for doubt in doubts:
        say(f"! {doubt}")
    if arguments.html is not None:
        try:
            arguments.html.write_text(sight_page(sight))
        except OSError as error:
            raise InvalidInputError("--html", f"{arguments.html} cannot be written: {error}", "a file") from error
    return int(bool(doubts) or any(found.pose is None for found in sight.objects))


def _bumped(table: Table, frame: RgbdFrame) -> str:
    """Return that a camera sees the table at another place; empty if it does not."""
    try:
        table.check([frame])
    except CameraError as error:
        return str(error)
    return ""


def _models(client: RoboPromptClient, task: str, names: Sequence[str] | None) -> Mapping[str, Any]:
    known = models_of(client, task)
    if names is None:
        return known
    if missing := [name for name in names if name not in known]:
        remedy = f"one of {', '.join(known) or 'none yet'}; `roboprompt-robot label` shows it to the service"
        raise InvalidInputError("--find", f"{missing[0]!r} is not known to the task {task!r}", remedy)
    return {name: known[name] for name in names}


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
        if task_document(client, arguments.task) is None:  # labels belong to one
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
        with guided_by_hand(arm):
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


def _pixel(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidInputError("--click", f"has {text!r}", "CAMERA COLUMN ROW, such as `front 312 205`") from error


def _symmetry(text: str) -> str | float:
    return text if text in ("none", "yaw") else float(text)
