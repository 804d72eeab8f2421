"""`roboprompt eval`: how well methods do on unseen scenes of many tasks."""

import inspect
import json
from typing import TYPE_CHECKING, Any, get_type_hints

import typer
from rich.console import Console

from app.cli.evaluate_options import EvaluateOptions
from app.cli.shared import check_models, check_names, progress_bars, refusals_said, service_at

if TYPE_CHECKING:
    from app.evaluation.sweep_run import SweepResult

PACE_S = 600.0  # the time left follows from the pace of the last ten minutes: methods differ in theirs
MAX_ERRORS = 5  # kinds of errors that the terminal shows; table.md has all
INTERRUPTED = 130  # the exit status of a program that Ctrl-C ended


def evaluate(**options: Any) -> None:  # noqa: ANN401
    """Teach tasks to the service, test methods on unseen scenes, and compare them with the paper's numbers.

    Results are kept as they come: the same command with the same --out continues where an earlier one stopped.
    """
    # The simulator is an extra that `roboprompt serve` does without.
    from app.cli.evaluate_plan import sweep_of
    from app.evaluation.sweeps import SWEEPS

    asked = EvaluateOptions(**options)
    check_names("--sweep", [asked.sweep_name], SWEEPS)
    console = Console(stderr=asked.as_json)
    run = sweep_of(asked)
    if asked.url is not None:
        with service_at(asked.url) as client:
            client.ping()
    check_models(asked.model or (), asked.url)
    with refusals_said(), progress_bars(console, PACE_S) as progress:
        result = run(progress)
    _tell(console, result, asked)
    if asked.as_json:
        plan = run.plan
        scenes = {"recordings": asked.recordings, "seed": plan.first_test_seed, "episodes": plan.episodes}
        known = {"sweep": asked.sweep_name, "out": str(asked.folder), **scenes}
        print(json.dumps({**known, **result.summary()}))  # noqa: T201
    if result.remaining:
        raise typer.Exit(INTERRUPTED if result.stopped == "interrupted" else 1)


# Typer reads a command's options from its signature.
evaluate.__signature__ = inspect.signature(EvaluateOptions)  # type: ignore[attr-defined]
evaluate.__annotations__ = get_type_hints(EvaluateOptions, include_extras=True)


def _tell(console: Console, result: "SweepResult", asked: EvaluateOptions) -> None:
    from app.evaluation.scores import errors_of
    from app.evaluation.tables import results_table

    console.print(results_table(result.evaluation))
    errors = [f"error in {number} trials: {message}" for message, number in errors_of(result.evaluation)]
    rest = [f"{result.stopped or 'errors'}: {result.remaining} trials remain; go on with:", asked.command]
    lines = [f"results: {asked.folder}", *errors[:MAX_ERRORS], *(rest if result.remaining else [])]
    console.print(*lines, sep="\n", markup=False, highlight=False, soft_wrap=True)
