"""`roboprompt cases`: predictions that were kept are asked again, and what moved is said."""

import json
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from math import degrees, dist
from typing import Annotated, Any

import typer
from rich.console import Console

from app.cli.shared import URL_HELP, service_at
from roboprompt_client import quaternions
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.errors import ServiceProblemError

MOVED_M, MOVED_DEG = 0.0005, 0.05
# Of a request beside its objects: images are not sent again, and a closed loop has no beginning of its own.
ASKED_OTHERWISE = ("task", "instruction", "objects", "cameras", "closed_loop", "after", "dry_run", "stream_text")
application = typer.Typer(no_args_is_help=True, help="Predictions that were kept as cases, to be asked again.")
Document = Mapping[str, Any]


@application.command()
def run(
    url: Annotated[str, typer.Option(help=URL_HELP)] = DEFAULT_URL,
    task: Annotated[str | None, typer.Option(help="only the cases of this task")] = None,
    model: Annotated[str | None, typer.Option(help="ask this LLM instead of each case's own")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object a case")] = False,
) -> None:
    """Ask all kept cases again, and say which answers are others than they were.

    Objects stand where they were seen: where images were sent, they are given as poses. The exit status is 1 if an
    answer moved.
    """
    console, moved = Console(), 0
    with service_at(url) as client:
        for case in cases_of(client, task):
            said = compare(case, ask_again(client, case, model))
            moved += said != "same"
            where = f"{case['id'][:8]} {case['task']}: {case['instruction']}"
            line = json.dumps({"id": case["id"], "moved": said}) if as_json else f"{said}\t{where}"
            console.print(line, markup=False, highlight=False, soft_wrap=True)
    raise typer.Exit(1 if moved else 0)


def cases_of(client: RoboPromptClient, task: str | None) -> Iterator[Document]:
    """Every case, the newest first."""
    asked: dict[str, Any] = {"cases": True, "limit": 50} | ({} if task is None else {"task": task})
    while True:
        page = client.get("/predictions", **asked)
        yield from page["predictions"]
        if page["next_cursor"] is None:
            return
        asked["cursor"] = page["next_cursor"]


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
    """What moved, in words: `same`, or the greatest change of the actions."""
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
