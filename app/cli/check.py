"""`roboprompt check`: whether a task's demonstrations predict each other, before a robot moves."""

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError

COLORS = {"info": "cyan", "warning": "yellow", "danger": "red"}
SHOWN_CHARS = 8  # of an episode's id
Document = Mapping[str, Any]


def check(
    task: Annotated[str, typer.Argument(help="a task with demonstrations")],
    url: Annotated[str, typer.Option(help="of the running service")] = DEFAULT_URL,
    model: Annotated[str | None, typer.Option(help="ask this LLM as well, see GET /models; some seconds each")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print the service's answer as one line of JSON")] = False,
    strict: Annotated[bool, typer.Option(help="exit with status 1 if there is a warning or a danger")] = False,
) -> None:
    """Predict each of a task's demonstrations from the others, and say what would go wrong and what to do.

    Without --model this asks no LLM. The exit status is 0 whatever is found, unless --strict says otherwise.
    """
    try:
        with RoboPromptClient(url) as client:
            answer = client.check(task, model)
    except (ServiceProblemError, ServiceUnreachableError) as error:
        Console(stderr=True).print(str(error), markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    if as_json:
        print(json.dumps(answer))  # noqa: T201
    else:
        show(answer, Console())
    if strict and any(finding["severity"] != "info" for finding in answer["findings"]):
        raise typer.Exit(1)


def show(answer: Document, console: Console) -> None:
    """Print an answer of `GET /tasks/{name}/check`, for people."""
    checked, number = answer["num_checked"], answer["num_episodes"]
    of_all = f"{number}" if checked == number else f"{checked} of {number}"
    console.print(f"[bold]{escape(answer['task'])}[/]: {of_all} demonstrations, keyframes by {answer['rule']}")
    for finding in answer["findings"]:
        color = COLORS[finding["severity"]]
        console.print(f"\n[{color}]{finding['severity']}[/] [bold]{finding['code']}[/]", highlight=False)
        console.print(escape(finding["message"]), highlight=False)
    if not answer["findings"]:
        console.print("\n[green]Nothing is amiss: the demonstrations predict each other.[/]")
    for place, plan in enumerate(answer["plans"]):
        console.print(f"\n[bold]Plan {place + 1}[/]: {_title(plan)}", highlight=False)
        console.print(_row_table(plan["rows"]))
        console.print(_episode_table(plan))
    if answer["replies"]:
        console.print(f"\n[bold]{escape(answer['model'])}[/], shown the other demonstrations:", highlight=False)
        console.print(_reply_table(answer["replies"]))


def _title(plan: Document) -> str:
    number = len(plan["episodes"])
    title = f"{number} demonstration{'' if number == 1 else 's'} of {_several([repr(i) for i in plan['instructions']])}"
    return title if plan["shown"] else f"{title}, left out of prompts"


def _row_table(rows: Sequence[Document]) -> Table:
    table = _table()
    for name in ("Row", "Follows", "Gripper", "Error", "Worst", "Varies"):
        table.add_column(name, justify="left" if name in ("Follows", "Gripper") else "right")
    for number, row in enumerate(rows, start=1):
        gripper = ("opens" if row["gripper_open"] else "closes") if row["switches"] else ""
        errors = [_off(row[f"{name}_cm"], row[f"{name}_deg"]) for name in ("error", "worst", "varies")]
        table.add_row(f"{number}", _follows(row), gripper, *errors)
    return table


def _follows(row: Document) -> str:
    if not row["objects"]:
        return f"the {row['frame']}"
    return _several(row["objects"])


def _episode_table(plan: Document) -> Table:
    table = _table()
    for name in ("Demonstration", "Manner", "Worst row", "Error", "Path"):
        table.add_column(name, justify="right" if name in ("Error", "Path") else "left")
    for episode in plan["episodes"]:
        worst = _worst(episode)
        name = f"{episode['id'][:SHOWN_CHARS]}{' [yellow]unlike the others[/]' if episode['unlike_others'] else ''}"
        row, error = ("", "") if worst is None else (f"{worst + 1}", _off_at(episode, worst))
        table.add_row(name, episode["manner"], row, error, f"{episode['path_cm']:.1f} cm")
    return table


def _reply_table(replies: Sequence[Document]) -> Table:
    table = _table()
    for name in ("Demonstration", "Worst row", "Error", ""):
        table.add_column(name, justify="right" if name == "Error" else "left")
    for reply in replies:
        worst = _worst(reply)
        row, error = ("", "") if worst is None else (f"{worst + 1}", _off_at(reply, worst))
        said = reply["problem"] or ("too far off" if reply["wrong"] else "")
        table.add_row(reply["episode_id"][:SHOWN_CHARS], row, error, escape(said))
    return table


def _table() -> Table:
    return Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))


def _worst(errors: Document) -> int | None:
    """The row with the largest distance; None where nothing was compared."""
    found: list[float] = errors["error_cm"]
    return max(range(len(found)), key=found.__getitem__) if found else None


def _off_at(errors: Document, row: int) -> str:
    return _off(errors["error_cm"][row], errors["error_deg"][row])


def _off(distance_cm: float | None, angle_deg: float | None) -> str:
    return "" if distance_cm is None else f"{distance_cm:.1f} cm {angle_deg:.0f}°"


def _several(names: Sequence[str]) -> str:
    """The first, and how many more."""
    return escape(names[0]) + (f" and {len(names) - 1} more" if len(names) > 1 else "")
