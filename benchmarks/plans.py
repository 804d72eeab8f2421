"""Counts the sentences over several tasks that become the right steps, are refused, or become wrong steps.

``python -m benchmarks.plans [FILE] [--room NAME] [--json]``. The file has rooms, each with its objects, its tasks
(their objects and taught instructions), what people ask with the plans that are right, and what must be refused.
`may_refuse` marks requests that may be obeyed or refused; `places_m` are the objects' positions.
"""

import argparse
import json
import statistics
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from app.pipeline.errors import InstructionError
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import TaughtWords
from app.pipeline.steps.reading import read_steps
from app.pipeline.steps.skills import Skill, TasksOfScene

ASKED = Path(__file__).with_suffix(".json")
RIGHT, REFUSED, UNCLEAR, WRONG = "right", "refused rightly", "refused though clear", "wrong"


class Answer(NamedTuple):
    """The outcome of one request.

    Attributes:
        steps: their instructions; empty if it was refused, for the reason `why`.
        took_ms: to read it.
    """

    room: str
    said: str
    kind: str
    steps: list[str]
    why: str
    took_ms: float


def answers(rooms: dict[str, Any]) -> Iterator[Answer]:
    """Yield the outcome of every request."""
    for name, room in rooms.items():
        skills = [
            Skill(task, TaughtWords(taught["objects"], {}, taught["instructions"]))
            for task, taught in room["tasks"].items()
        ]
        scene = TasksOfScene(room["objects"], {}, skills)
        places_m = {name: np.array(place_m) for name, place_m in room.get("places_m", {}).items()}
        layout = Layout(places_m, np.zeros(3)) if places_m else None
        for ask in [*room["asks"], *({"said": said, "plans": []} for said in room["refused"])]:
            steps, why, began_s = list[str](), "", time.perf_counter()
            try:
                steps = [step.instruction for step in read_steps(ask["said"], scene, layout)]
            except InstructionError as error:
                why = error.message
            took_ms = 1000 * (time.perf_counter() - began_s)
            yield Answer(name, ask["said"], _kind(steps, ask), steps, why, took_ms)


def _kind(steps: list[str], ask: dict[str, Any]) -> str:
    if not steps:
        return UNCLEAR if ask["plans"] and not ask.get("may_refuse") else REFUSED
    return RIGHT if steps in ask["plans"] else WRONG


def main() -> None:
    """Print the outcome of every request, and their counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, default=ASKED)
    parser.add_argument("--room", action="append", help="only this one, may be repeated")
    parser.add_argument("--json", action="store_true", help="print the counts only")
    arguments = parser.parse_args()
    rooms = json.loads(arguments.file.read_text())
    found = list(answers({name: rooms[name] for name in arguments.room or rooms}))
    console = Console()
    counts = Counter(answer.kind for answer in found)
    if not arguments.json:
        for answer in sorted(found, key=lambda answer: (WRONG, UNCLEAR, REFUSED, RIGHT).index(answer.kind)):
            said = f"{answer.kind:21} {answer.room}: {answer.said!r} -> {answer.steps or answer.why}"
            console.print(said, markup=False, highlight=False, soft_wrap=True)
    took = {"median_ms": round(statistics.median(answer.took_ms for answer in found), 1)}
    console.print_json(data={**{kind: counts[kind] for kind in (RIGHT, UNCLEAR, REFUSED, WRONG)}, **took}, indent=None)


if __name__ == "__main__":
    main()
