"""`roboprompt check`: what a task's demonstrations share, and which is unlike the others, before a robot moves."""

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
SHOWN_CHARS = 8  # of an episode's id
Document = Mapping[str, Any]


def check(
    task: Annotated[str, typer.Argument(help="a task with demonstrations")],
    url: Url = DEFAULT_URL,
    as_json: Annotated[bool, typer.Option("--json", help="print the service's answer as one line of JSON")] = False,
    strict: Annotated[bool, typer.Option(help="exit with status 1 if there is a warning or a danger")] = False,
) -> None:
    """Hold each of a task's demonstrations against the others, and say what would go wrong and what to do.

    The exit status is 0 whatever is found, unless --strict says otherwise.
    """
    with service_at(url) as client:
        answer = client.check(task)
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
    console.print(f"[bold]{escape(answer['task'])}[/]: {of_all} demonstration{'' if number == 1 else 's'}")
    for finding in answer["findings"]:
        color = COLORS[finding["severity"]]
        console.print(f"\n[{color}]{finding['severity']}[/] [bold]{finding['code']}[/]", highlight=False)
        console.print(escape(finding["message"]), highlight=False)
    if not answer["findings"]:
        console.print("\n[green]Nothing is amiss: the demonstrations agree with each other.[/]")
    for place, plan in enumerate(answer["plans"]):
        console.print(f"\n[bold]Plan {place + 1}[/]: {_title(plan)}", highlight=False)
        console.print(_rows(plan["rows"]))
        console.print(_episodes(plan["episodes"]))


def _title(plan: Document) -> str:
    number = len(plan["episodes"])
    title = f"{number} demonstration{'' if number == 1 else 's'} of {escape(repr(plan['instructions'][0]))}"
    more = f" and {len(plan['instructions']) - 1} more" if plan["instructions"][1:] else ""
    when = f", where {escape(' and '.join(plan['when']))}" if plan["when"] else ""
    return f"{title}{more}{when}{'' if plan['used'] else ', not used: nothing says when'}"


def _rows(rows: Sequence[Document]) -> Table:
    table = _table("Row", "Follows", "Gripper", "Scatter")
    for number, row in enumerate(rows):
        gripper = ("opens" if row["gripper_open"] else "closes") if row["switches"] else ""
        off = f"{row['scatter_cm']:.1f} cm {row['scatter_deg']:.0f}°"
        table.add_row(f"{number}", escape(row["follows"]), gripper, off)
    return table


def _episodes(episodes: Sequence[Document]) -> Table:
    table = _table("Demonstration", "Least probable", "p")
    for episode in episodes:
        one = episode["least_probable"]
        said = ("", "") if one is None else (escape(one["coordinate"]), f"{one['p']:.2g}")
        table.add_row(episode["id"][:SHOWN_CHARS], *said)
    return table


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name in columns:
        table.add_column(name)
    return table
