"""`roboprompt eval`: how well methods do on unseen scenes of many tasks."""

import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

import app.cli.evaluate_options as options
from app.cli.evaluate_options import PAPER, Asked
from app.cli.evaluate_plan import command_of, paper_of, sweep_of
from app.cli.shared import check_models, check_names, check_service

if TYPE_CHECKING:
    from app.evaluation.plan import Plan
    from app.evaluation.sweep_run import SweepResult, SweepRun

PACE_S = 600.0  # the time left follows from the pace of the last ten minutes: methods differ in theirs
MAX_ERRORS = 5  # kinds of errors that the terminal shows; table.md has all
INTERRUPTED = 130  # the exit status of a program that Ctrl-C ended
BUDGET_SPENT = 3  # the exit status of a run that its budget stopped


def evaluate(
    sweep: options.Sweep = "main",
    task: options.Tasks = None,
    episodes: options.Episodes = None,
    demos: options.Demos = 10,
    model: options.Models = None,
    poses: options.Poses = "given",
    method: options.Methods = None,
    recordings: options.Recordings = "rests",
    seed: options.Seed = 100_000,
    noise: options.Noise = None,
    noise_on: options.NoiseOn = "both",
    shift: options.Shift = None,
    out: options.Out = None,
    ray: options.Ray = None,
    url: options.Url = None,
    at_once: options.AtOnce = 1,
    report: options.Report = True,
    table: options.Tables = None,
    price_in: options.PriceIn = None,
    price_out: options.PriceOut = None,
    budget: options.Budget = None,
    yes: options.Yes = False,
    as_json: options.AsJson = False,
) -> None:
    """Teach tasks to the service, test methods on unseen scenes, and hold them against the paper's numbers.

    Results are kept as they come: the same command with the same --out goes on where an earlier one stopped.
    """
    several = {"task": task, "model": model, "method": method, "table": table}
    asked = Asked(
        sweep=sweep,
        **{name: tuple(given or ()) for name, given in several.items()},
        episodes=episodes,
        demos=demos,
        poses=poses,
        recordings=recordings,
        seed=seed,
        noise=noise,
        noise_on=noise_on,
        shift=shift,
        out=out,
        ray=ray,
        url=url,
        at_once=at_once,
        report=report,
        price_in=tuple(price_in or ()),
        price_out=tuple(price_out or ()),
        budget=budget,
        yes=yes,
        words=tuple(sys.argv[1:]),
    )
    _evaluate(asked, as_json=as_json)


def _evaluate(asked: Asked, *, as_json: bool) -> None:
    # The simulator is an extra that `roboprompt serve` does without.
    from app.evaluation.methods import SWEEPS
    from app.sim.tasks import ALL_TASKS

    check_names("--sweep", [asked.sweep], [*SWEEPS, PAPER])
    check_names("--task", asked.task, ALL_TASKS)
    console = Console(stderr=as_json)
    progress = _progress(console)
    run = paper_of(asked, console, progress) if asked.sweep == PAPER else sweep_of(asked)
    if asked.url is not None:
        check_service(asked.url)
    check_models(asked.model, asked.url)
    result = _result(run, progress, console)
    _tell(console, result, asked)
    if as_json:
        known = {"sweep": asked.sweep, "out": str(asked.folder), **_scenes(run.plan)}
        print(json.dumps({**known, **result.summary()}))  # noqa: T201
    if result.remaining:
        raise typer.Exit(_status(result))


def _result(run: "SweepRun", progress: Progress, console: Console) -> "SweepResult":
    from app.evaluation.failures import EvaluationError
    from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError

    try:
        with progress:
            return run(progress)
    except (EvaluationError, ServiceUnreachableError, ServiceProblemError, ConnectionError) as error:
        _say(console, [str(error)])
        raise typer.Exit(1) from error


def _status(result: "SweepResult") -> int:
    from app.evaluation.sweep_run import BUDGET

    if result.stopped.startswith(BUDGET):
        return BUDGET_SPENT
    return INTERRUPTED if result.stopped == "interrupted" else 1


def _scenes(plan: "Plan") -> dict[str, object]:
    """How demonstrations were recorded, and which scenes were tested, for programs."""
    return {"recordings": plan.recordings, "seed": plan.first_test_seed, "episodes": plan.episodes}


def _tell(console: Console, result: "SweepResult", asked: Asked) -> None:
    from app.evaluation.result_tables import terminal_table
    from app.evaluation.scores import errors_of

    if asked.sweep == PAPER:
        _say(console, [(asked.folder / "table.md").read_text(encoding="utf-8")])
    else:
        console.print(terminal_table(result.evaluation, console.width))
    errors = [f"error in {number} trials: {message}" for message, number in errors_of(result.evaluation)]
    rest = [f"{result.stopped or 'errors'}: {result.remaining} trials remain; go on with:", command_of(asked)]
    _say(console, [f"results: {asked.folder}", *errors[:MAX_ERRORS], *(rest if result.remaining else [])])


def _say(console: Console, lines: Sequence[str]) -> None:
    console.print(*lines, sep="\n", markup=False, highlight=False, soft_wrap=True)


def _progress(console: Console) -> Progress:
    columns = (
        TextColumn("{task.description:<15}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=console, speed_estimate_period=PACE_S)
