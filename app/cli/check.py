"""`roboprompt check`: whether a task's demonstrations predict each other, before a robot moves.

`roboprompt cases`: asks kept predictions again and prints which answers changed.
"""

import json
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from math import degrees, dist
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from app.cli.shared import Url, paged_items, service_at
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.types import quaternions

COLORS = {"info": "cyan", "warning": "yellow", "danger": "red"}
FIGURES = ("Row", "Error", "Worst", "Varies", "Path")  # columns of numbers
SHOWN_CHARS = 8  # of an episode's id
MOVED_M, MOVED_DEG = 0.0005, 0.05
# Of a request beside its objects: images are not sent again.
ASKED_OTHERWISE = ("task", "instruction", "objects", "cameras", "dry_run", "stream_text")
cases = typer.Typer(no_args_is_help=True, help="Predictions that were kept as cases, to be asked again.")
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


@cases.command("run")
def run_cases(
    url: Url = DEFAULT_URL,
    task: Annotated[str | None, typer.Option(help="only the cases of this task")] = None,
    model: Annotated[str | None, typer.Option(help="ask this LLM instead of each case's own")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object a case")] = False,
) -> None:
    """Ask all kept cases again, and print which answers changed.

    Objects have the poses that were observed then; images are not sent again. The exit status is 1 if an
    answer moved.
    """
    console, moved = Console(), 0
    with service_at(url) as client:
        for case in paged_items(client, "/predictions", cases=True, limit=50, task=task):
            said = compare(case, ask_again(client, case, model))
            moved += said != "same"
            where = f"{case['id'][:8]} {case['task']}: {case['instruction']}"
            line = json.dumps({"id": case["id"], "moved": said}) if as_json else f"{said}\t{where}"
            console.print(line, markup=False, highlight=False, soft_wrap=True)
    raise typer.Exit(1 if moved else 0)


def ask_again(client: RoboPromptClient, case: Document, model: str | None) -> Document:
    """The answer now; `error` where it is a refusal.

    Raises:
        ServiceUnreachableError: if the service does not answer.
    """
    settings = {name: value for name, value in case["request"].items() if name not in ASKED_OTHERWISE}
    seen = [{name: item[name] for name in ("name", "position", "quaternion_xyzw")} for item in case["objects"]]
    scene = {"task": case["task"], "instruction": case["instruction"], "objects": seen}
    try:
        return client.post("/predict", {**settings, **scene, "model": model or case["model"]})
    except ServiceProblemError as error:
        return {"actions": None, "error": str(error)}


def compare(before: Document, now: Document) -> str:
    """Return the greatest change of the actions in words, or `same`."""
    if not before["actions"] or not now["actions"]:
        if bool(before["actions"]) == bool(now["actions"]):
            return "same"
        return f"no actions now: {now['error']}" if before["actions"] else "actions now, none before"
    pairs = list(zip_longest(before["actions"], now["actions"]))
    if any(None in pair for pair in pairs):
        return f"{len(now['actions'])} actions instead of {len(before['actions'])}"
    if grippers := [k for k, (one, other) in enumerate(pairs, 1) if one["gripper_open"] != other["gripper_open"]]:
        return f"the gripper of action {grippers[0]}"
    away_m = max(dist(one["position"], other["position"]) for one, other in pairs)
    turned = max(quaternions.angle_between_rad(one["quaternion_xyzw"], two["quaternion_xyzw"]) for one, two in pairs)
    if away_m < MOVED_M and degrees(turned) < MOVED_DEG:
        return "same"
    return f"moved by {100 * away_m:.1f} cm, {degrees(turned):.1f} degrees"
