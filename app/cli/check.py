"""`roboprompt check`: whether a task's demonstrations predict each other, before a robot moves."""

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from app.cli.shared import Url, service_at
from roboprompt_client.client import DEFAULT_URL

COLORS = {"info": "cyan", "warning": "yellow", "danger": "red"}
FIGURES = ("Row", "Error", "Worst", "Varies", "Path")  # columns of numbers
SHOWN_CHARS = 8  # of an episode's id
Document = Mapping[str, Any]


def check(
    task: Annotated[str, typer.Argument(help="a task with demonstrations")],
    url: Url = DEFAULT_URL,
    model: Annotated[str | None, typer.Option(help="ask this LLM as well, see GET /models; some seconds each")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print the service's answer as one line of JSON")] = False,
    strict: Annotated[bool, typer.Option(help="exit with status 1 if there is a warning or a danger")] = False,
) -> None:
    """Predict each of a task's demonstrations from the others, and say what would go wrong and what to do.

    Without --model this asks no LLM. The exit status is 0 whatever is found, unless --strict says otherwise.
    """
    with service_at(url) as client:
        answer = client.check(task, model)
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
    of_all += " demonstration" if number == 1 else " demonstrations"
    console.print(f"[bold]{escape(answer['task'])}[/]: {of_all}, keyframes by {answer['rule']}")
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
    table = _table("Row", "Follows", "Gripper", "Error", "Worst", "Varies")
    for number, row in enumerate(rows, start=1):
        follows = _several(row["objects"]) if row["objects"] else f"the {row['frame']}"
        gripper = ("opens" if row["gripper_open"] else "closes") if row["switches"] else ""
        errors = [_off(row[f"{name}_cm"], row[f"{name}_deg"]) for name in ("error", "worst", "varies")]
        table.add_row(f"{number}", follows, gripper, *errors)
    return table


def _episode_table(plan: Document) -> Table:
    table = _table("Demonstration", "Manner", "Worst row", "Error", "Path")
    for episode in plan["episodes"]:
        name = f"{episode['id'][:SHOWN_CHARS]}{' [yellow]unlike the others[/]' if episode['unlike_others'] else ''}"
        table.add_row(name, episode["manner"], *_worst(episode), f"{episode['path_cm']:.1f} cm")
    return table


def _reply_table(replies: Sequence[Document]) -> Table:
    table = _table("Demonstration", "Worst row", "Error", "")
    for reply in replies:
        said = reply["problem"] or ("too far off" if reply["wrong"] else "")
        table.add_row(reply["episode_id"][:SHOWN_CHARS], *_worst(reply), escape(said))
    return table


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name in columns:
        table.add_column(name, justify="right" if name in FIGURES else "left")
    return table


def _worst(errors: Document) -> tuple[str, str]:
    """The number of the row with the largest distance, and how far it is off; empty where nothing was compared."""
    pairs = list(zip(errors["error_cm"], errors["error_deg"], strict=True))
    if not pairs:
        return "", ""
    worst = max(range(len(pairs)), key=lambda row: pairs[row][0])
    return f"{worst + 1}", _off(*pairs[worst])


def _off(distance_cm: float | None, angle_deg: float | None) -> str:
    return "" if distance_cm is None else f"{distance_cm:.1f} cm {angle_deg:.0f}°"


def _several(names: Sequence[str]) -> str:
    """The first, and how many more."""
    return escape(names[0]) + (f" and {len(names) - 1} more" if len(names) > 1 else "")
