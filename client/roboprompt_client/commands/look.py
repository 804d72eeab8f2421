"""`roboprompt-robot look`: what the cell's cameras see, and where the service finds a task's objects."""

from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from roboprompt_client.cameras.sight import Sight, sight_page
from roboprompt_client.cameras.table import Table
from roboprompt_client.cell import read_cell, write_cell
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.shared import CELL, AddCommand, add_find, in_columns, models_of, say, seeing_arm
from roboprompt_client.errors import CameraError, InvalidInputError


def add_look(add: AddCommand) -> None:
    """Add `look` to the commands."""
    look = add("look", "show what the cameras see, and where the service finds a task's objects", run_look)
    look.add_argument("--robot", required=True, metavar="CELL", help=CELL)
    look.add_argument("--task", help="find this task's objects (default: none)")
    add_find(look)
    look.add_argument("--remember", action="store_true", help="write the table's place into the cell's file")
    look.add_argument("--html", type=Path, metavar="FILE", help="also write a page of the pictures with the objects")


def run_look(client: RoboPromptClient, arguments: Namespace) -> int:
    """Print the tables, and write the page; return 1 if a camera seems wrong or an object is not found."""
    models = {} if arguments.task is None else _models(client, arguments.task, arguments.find)
    with seeing_arm(arguments.robot) as arm:
        sight, table = Sight.of(client, arm.frames(), models), arm.cameras.table
    doubts = sight.doubts()
    if arguments.remember and not doubts:
        path = Path(arguments.robot)
        write_cell(path, {**read_cell(path), "table": Table.seen_in(sight.frames).to_json()})
        say(f"the table's place is written to {path}")
    elif table is not None:
        doubts += _bumped(table, sight)
    tables = [sight.camera_rows(), *([sight.object_rows()] if models else [])]
    said = "\n\n".join(map(in_columns, tables)) + "".join(f"\n! {doubt}" for doubt in doubts)
    say(said)
    if arguments.html is not None:
        try:
            arguments.html.write_text(sight_page(sight, said))
        except OSError as error:
            raise InvalidInputError("--html", f"{arguments.html} cannot be written: {error}", "a file") from error
    return int(bool(doubts) or any(found.pose is None for found in sight.objects))


def _bumped(table: Table, sight: Sight) -> list[str]:
    """Return for each camera that sees the table at another place that it does."""
    found = []
    for frame in sight.frames:
        try:
            table.check([frame])
        except CameraError as error:
            found.append(str(error))
    return found


def _models(client: RoboPromptClient, task: str, names: Sequence[str] | None) -> Mapping[str, Any]:
    known = models_of(client, task)
    if names is None:
        return known
    if missing := [name for name in names if name not in known]:
        remedy = f"one of {', '.join(known) or 'none yet'}; the task's page shows it to the service"
        raise InvalidInputError("--find", f"{missing[0]!r} is not known to the task {task!r}", remedy)
    return {name: known[name] for name in names}
