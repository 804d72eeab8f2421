"""Wrong recordings and scenes, sent to a service; what it answers is carried out in the simulation.

`python -m benchmarks.adversary --seeds 3 --every 3`: each kind of case on each of the 21 tasks. One of them is shown by
`--kind NAME --task TASK --seed N --show`. With `--data` the results stay, a line each, and a run that was broken off
goes on. The last line is one JSON object with `silent_failure_rate` and `false_alarm_rate`.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from app.evaluation.run import SIMULATION, executor_of
from app.evaluation.server import running_server
from app.evaluation.world import world_named
from app.executors import LocalExecutor
from app.sim.tasks import TASKS
from benchmarks.adversary.kinds import KINDS
from benchmarks.adversary.measure import Outcome
from benchmarks.adversary.run import DEMONSTRATIONS, Run
from benchmarks.adversary.table import shown, summary, tables
from benchmarks.adversary.words import WORDINGS
from roboprompt_client.client import RoboPromptClient

PANDA = "app.evaluation.world"
SERVICE = {
    "ROBOPROMPT_WARM_UP": "false",
    "ROBOPROMPT_DEFAULT_MODEL": "nearest",
    "ROBOPROMPT_RATE_LIMIT_PER_S": "100000",
}


def main() -> None:
    """Run it and print the tables."""
    asked = _parser().parse_args()
    with tempfile.TemporaryDirectory(prefix="roboprompt-") as own:
        folder = asked.data or Path(own)
        folder.mkdir(parents=True, exist_ok=True)
        outcomes = _run(asked, folder)
    report = f"{tables(outcomes, 'python -m benchmarks.adversary')}\n"
    if asked.report is not None:
        asked.report.write_text(report)
    if not asked.show:
        sys.stdout.write(report)
    print(json.dumps(summary(outcomes)))  # noqa: T201 - the last line is for programs


def _run(asked: argparse.Namespace, folder: Path) -> list[Outcome]:
    world = world_named(asked.world)
    tasks = asked.task or (list(TASKS) if asked.world == PANDA else list(world.tasks))
    seeds = range(asked.seed, asked.seed + asked.seeds)
    executor = executor_of(world) if world.python else LocalExecutor(1, SIMULATION)  # one core is enough
    with (
        tempfile.TemporaryDirectory(prefix="roboprompt-") as data,
        running_server(Path(data), SERVICE) as url,
        RoboPromptClient(url) as client,
        closing(executor),
    ):
        kinds = asked.kind or list(KINDS)
        wording, results = WORDINGS.get(asked.words), folder / "outcomes.jsonl"
        run = Run(client, executor, world, tasks, kinds, seeds, asked.every, asked.demos, results, wording)
        return _followed(run(), show=asked.show)


def _followed(outcomes: Iterable[tuple[Outcome, Mapping[str, Any]]], *, show: bool) -> list[Outcome]:
    """Return the outcomes, and report progress."""
    started, done = time.monotonic(), []
    for outcome, answer in outcomes:
        done.append(outcome)
        if show:
            sys.stdout.write(shown(outcome, answer))
        elif (outcome.wrong and outcome.ending == "silent") or len(done) % 25 == 0:
            silent = sum(item.wrong and item.ending == "silent" for item in done)
            progress = f"{time.monotonic() - started:.0f} s: {len(done)} cases, {silent} failed silently; last: "
            sys.stderr.write(f"{progress}{outcome.kind}, {outcome.task} {outcome.seed}: {outcome.ending}\n")
    return done


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.adversary", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kind", action="append", choices=list(KINDS), metavar="KIND", help="default: all")
    parser.add_argument("--task", action="append", metavar="TASK", help="default: all of the world")
    parser.add_argument("--seed", type=int, default=0, help="the first; odd ones are recorded continuously")
    parser.add_argument("--seeds", type=int, default=1, help="how many follow each other")
    parser.add_argument("--every", type=int, default=1, help="a task and seed has one wrong kind in so many, in turn")
    parser.add_argument("--demos", type=int, default=DEMONSTRATIONS, help="recordings of each case")
    parser.add_argument("--words", choices=list(WORDINGS), help="instructions in other words; default: as they are")
    parser.add_argument("--world", default=PANDA, help="module with a WORLD, e.g. benchmarks.metaworld.world")
    parser.add_argument("--data", type=Path, help="folder of the results; default: none are kept")
    parser.add_argument("--report", type=Path, help="write the tables to this file, too")
    parser.add_argument("--show", action="store_true", help="each case with its findings and answer")
    return parser


if __name__ == "__main__":
    main()
