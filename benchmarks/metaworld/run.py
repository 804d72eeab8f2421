"""Meta-World's tasks through a RoboPrompt service, over HTTP only.

Each task is taught with demonstrations by Meta-World's scripted policy; their keyframes are executed in their own
scenes (replay: what execution and keyframes leave possible), and predictions in unseen ones. `make metaworld` runs it
in an environment of its own, as metaworld pins another mujoco than the simulated Panda needs.
"""

import argparse
import json
import os
import platform
import shlex
import subprocess
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.metaworld.demonstrate import RATES_HZ, DemonstrationCache
from benchmarks.metaworld.ledger import Ledger, LedgerError
from benchmarks.metaworld.plan import Plan
from benchmarks.metaworld.scores import results, summary
from benchmarks.metaworld.server import own_service
from benchmarks.metaworld.service import Service, ServiceError
from benchmarks.metaworld.table import markdown
from benchmarks.metaworld.tasks import TASKS
from benchmarks.metaworld.trials import Benchmark

ROOT = Path(__file__).parents[2]
REPORTS = ROOT / "reports" / "metaworld"
DEFAULTS = Plan()


def main() -> int:
    """Run, print the table; returns the exit code."""
    arguments = parser().parse_args()
    try:
        print(run(arguments))  # noqa: T201
    except (LedgerError, ServiceError) as error:
        _report(str(error))
        return 1
    return 0


def run(arguments: argparse.Namespace) -> str:
    """Run what is asked for; what goes to standard output."""
    from benchmarks.metaworld import simulator  # here, so that the rest can be imported without Meta-World

    warnings.filterwarnings("ignore")  # Meta-World warns of its own policies' large steps
    np.seterr(all="ignore")
    plan, versions = plan_of(arguments), simulator.versions()
    cache = DemonstrationCache(arguments.cache / "-".join(f"{k}-{v}" for k, v in versions.items()))
    out = arguments.out or REPORTS / f"{datetime.now():%Y%m%d-%H%M%S}.jsonl"
    with Ledger(out, {**plan.conditions(), **versions}) as ledger:
        with _service(arguments) as service:
            Benchmark(plan, service, ledger, simulator.MetaWorld, cache, _report).run(arguments.tasks)
        found = results(ledger, arguments.tasks, plan.models)
    text = markdown(found, facts(plan, versions))
    if arguments.markdown:
        arguments.markdown.parent.mkdir(parents=True, exist_ok=True)
        arguments.markdown.write_text(f"# Meta-World\n\n{text}")
    _report(f"results: {out}")
    return f"{text}{json.dumps(summary(found))}" if arguments.json else text


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(prog="benchmarks.metaworld.run", description=__doc__)
    where = made.add_mutually_exclusive_group(required=True)
    where.add_argument("--url", help="of a service that runs")
    where.add_argument(
        "--serve-with", type=Path, metavar="PYTHON", help="start a service with this interpreter, which has the server"
    )
    add = made.add_argument
    add("--tasks", nargs="+", default=list(TASKS), choices=list(TASKS), metavar="TASK", help=", ".join(TASKS))
    add("--models", nargs="*", default=list(DEFAULTS.models), metavar="MODEL", help="as GET /models has them")
    add("--demos", type=_count, default=DEFAULTS.demos, help="demonstrations of each task")
    add("--tests", type=_count, default=DEFAULTS.tests, help="unseen scenes for models without an LLM; replays")
    add("--llm-tests", type=_count, default=DEFAULTS.llm_tests, help="unseen scenes for LLMs; 0 leaves them out")
    add("--seed", type=_count, default=DEFAULTS.first_test_seed, help="of the first unseen scene")
    add("--demo-seed", type=_count, default=DEFAULTS.first_demo_seed, help="of the first demonstration's scene")
    add("--noise", type=float, default=DEFAULTS.noise_m, metavar="METRES", help="standard deviation of positions")
    add("--noise-on", choices=("demos", "tests", "both"), default=DEFAULTS.noise_on, help="whose positions")
    add("--record-hz", type=int, choices=RATES_HZ, default=DEFAULTS.record_hz, help="rate of the recordings")
    add("--settings", type=_settings, metavar="JSON", help="of each task, for PUT /tasks; default: nothing is set")
    add("--cache", type=Path, default=REPORTS / "demonstrations", metavar="DIR", help="recorded demonstrations")
    add("--out", type=Path, metavar="FILE", help="results as JSON lines; a run goes on from those it finds there")
    add("--markdown", type=Path, metavar="FILE", help="write the table there as well")
    add("--json", action="store_true", help="end with one JSON object")
    return made


def plan_of(arguments: argparse.Namespace) -> Plan:
    """The plan that the command line describes."""
    return Plan(
        demos=arguments.demos,
        tests=arguments.tests,
        llm_tests=arguments.llm_tests,
        models=tuple(arguments.models),
        first_demo_seed=arguments.demo_seed,
        first_test_seed=arguments.seed,
        noise_m=arguments.noise,
        noise_on=arguments.noise_on,
        record_hz=arguments.record_hz,
        settings=arguments.settings,
    )


def facts(plan: Plan, versions: dict[str, str]) -> dict[str, str]:
    """How the results came about."""
    noise = f"{100 * plan.noise_m:g} cm on {plan.noise_on}" if plan.noise_m else "none"
    command = ["python", "-m", "benchmarks.metaworld.run", *sys.argv[1:]]
    return {
        "command": f"`{shlex.join(command)}`",
        "made": f"{datetime.now(UTC):%Y-%m-%d}, commit {_commit()}, {os.cpu_count()} cores",
        "versions": ", ".join(f"{k} {v}" for k, v in {"python": platform.python_version(), **versions}.items()),
        "recorded at": f"{plan.record_hz} Hz; noise on observed positions: {noise}",
        "set at the service": f"`{json.dumps(plan.settings)}`" if plan.settings else "nothing",
        "seeds": f"demonstrations from {plan.first_demo_seed} on, unseen scenes from {plan.first_test_seed} on",
    }


@contextmanager
def _service(arguments: argparse.Namespace) -> Iterator[Service]:
    if arguments.url:
        with Service(arguments.url) as service:
            yield service
    else:
        with own_service(arguments.serve_with) as url, Service(url) as service:
            yield service


def _commit() -> str:
    """Of the source, marked if files differ from it."""
    command: Sequence[str] = ("git", "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude", "*")
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _count(text: str) -> int:
    number = int(text)
    if number < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return number


def _settings(text: str) -> dict[str, Any]:
    try:
        value = json.loads(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"not JSON: {error}") from error
    if not isinstance(value, dict):
        raise argparse.ArgumentTypeError('not an object such as {"keyframes": {"rule": "merged"}}')
    return value


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)  # noqa: T201


if __name__ == "__main__":
    sys.exit(main())
