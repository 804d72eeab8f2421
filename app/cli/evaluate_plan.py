"""What `roboprompt eval` is to run, from its options; each refusal names the option and what would be valid."""

import math
import shlex
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import typer
from rich.console import Console
from rich.progress import Progress

from app.cli.evaluate_options import EPISODES, PAPER, Asked
from app.cli.shared import check_names

if TYPE_CHECKING:
    from app.evaluation.paper_sweep import Estimate, PaperSweep
    from app.evaluation.plan import Plan
    from app.evaluation.sweep_run import SweepRun

T = TypeVar("T")


def command_of(asked: Asked) -> str:
    """The command line that goes on with the run."""
    return shlex.join(["roboprompt", *asked.words, *([] if asked.out else ["--out", str(asked.folder)])])


def sweep_of(asked: Asked) -> "SweepRun":
    """A sweep of `app.evaluation.methods`."""
    from app.evaluation.sweep_run import SweepRun

    given = {"--table": asked.table, "--price-in": asked.price_in, "--price-out": asked.price_out}
    _refuse({**given, "--budget": asked.budget is not None, "--yes": asked.yes}, f"is for --sweep {PAPER} alone")
    return SweepRun(asked.sweep, _plan(asked), asked.folder, asked.ray, asked.url, asked.report)


def paper_of(asked: Asked, console: Console, progress: Progress) -> "PaperSweep":
    """The paper's tables.

    Args:
        progress: pauses while the estimate is shown and agreed to.
    """
    from app.evaluation.costs import prices_of
    from app.evaluation.paper_sweep import PaperSweep
    from app.evaluation.paper_tables import limited, paper_plan, paper_tables

    _check_paper_options(asked)
    models = tuple(dict.fromkeys(asked.model))
    prices = _refusing(lambda: prices_of(asked.model, asked.price_in, asked.price_out), "--price-in, --price-out")
    every = {table.name: table for table in paper_tables(models)}
    check_names("--table", asked.table, every)
    wanted = [table for name, table in every.items() if not asked.table or name in asked.table]
    tables = limited(wanted, asked.task or None, asked.episodes)
    if not tables:
        _refuse({"--task": asked.task}, f"is in none of the tables {', '.join(table.name for table in wanted)}")
    plan = paper_plan(tables, asked.demos, command_of(asked), asked.at_once, asked.seed)

    def confirm(estimate: "Estimate") -> None:
        progress.stop()
        _confirm(estimate, asked, console)
        progress.start()

    return PaperSweep(
        PAPER,
        plan,
        asked.folder,
        asked.ray,
        None,
        asked.report,
        confirm=confirm,
        prices=prices,
        budget=asked.budget,
    )


def _confirm(estimate: "Estimate", asked: Asked, console: Console) -> None:
    """Show the estimate and ask whether to go on.

    Raises:
        NotConfirmedError: if not, or if nobody is there to answer.
    """
    from app.evaluation.estimates import estimate_table
    from app.evaluation.failures import NotConfirmedError

    console.print(estimate_table(estimate))
    if asked.yes:
        return
    if not sys.stdin.isatty():
        raise NotConfirmedError("no LLM was asked: nobody is at a terminal to agree to this estimate; --yes agrees")
    if not typer.confirm("Ask the LLM?", err=True):
        raise NotConfirmedError("no LLM was asked")


def _check_paper_options(asked: Asked) -> None:
    settled = {
        "--method": asked.method,
        "--noise": asked.noise is not None,
        "--noise-on": asked.noise_on != "both",
        "--shift": asked.shift is not None,
        "--poses": asked.poses != "given",
        "--recordings": asked.recordings != "rests",
    }
    _refuse(settled, f"does not go with --sweep {PAPER}, whose tables settle it")
    _refuse({"--url": asked.url}, f"does not go with --sweep {PAPER}: its own service records what the LLM says")
    _refuse({"--model": not asked.model}, f"is missing: --sweep {PAPER} asks a model by its name from GET /models")
    if asked.budget is not None:
        wrong = not (math.isfinite(asked.budget) and asked.budget > 0)
        _refuse({"--budget": wrong}, f"is {asked.budget:g} (valid: a finite amount above 0)")
        _refuse({"--budget": not asked.price_in}, "counts by prices: say --price-in and --price-out")


def _refuse(given: dict[str, object], why: str) -> None:
    for option, value in given.items():
        if value:
            raise typer.BadParameter(why, param_hint=option)


def _plan(asked: Asked) -> "Plan":
    from app.evaluation.methods import SWEEPS, chosen, with_noise, with_poses, with_shift
    from app.evaluation.plan import Plan

    given = SWEEPS[asked.sweep].with_models(asked.model)
    names = asked.method or (("default",) if asked.shift is not None else ())
    methods = _refusing(lambda: chosen(given, names, asked.model), "--method")
    methods = _refusing(lambda: with_noise(methods, asked.noise, asked.noise_on), "--noise")
    if asked.poses == "vision":
        methods = _refusing(lambda: with_poses(methods, "vision"), "--poses")
    tasks = tuple(dict.fromkeys(asked.task or SWEEPS[asked.sweep].tasks))
    if (shift := asked.shift) is not None:
        methods = _refusing(lambda: with_shift(methods, shift), "--shift")
        tasks = _shiftable(tasks, shift, named=bool(asked.task))
    return Plan(
        tasks,
        methods,
        asked.episodes or EPISODES,
        asked.demos,
        command_of(asked),
        predictions_at_once=asked.at_once,
        recordings=asked.recordings,
        first_test_seed=asked.seed,
        lending=SWEEPS[asked.sweep].lending,
    )


def _shiftable(tasks: tuple[str, ...], shift_m: float, *, named: bool) -> tuple[str, ...]:
    """The tasks whose objects can be moved; one that was named must be among them."""
    from app.sim.shift import can_shift

    movable = tuple(name for name in tasks if can_shift(name, shift_m))
    if not movable or (named and movable != tasks):
        fixed = next(name for name in tasks if name not in movable)
        message = f"{fixed}: nothing in its scenes can be moved freely by {shift_m:g} m"
        raise typer.BadParameter(message, param_hint="--shift")
    return movable


def _refusing(choose: Callable[[], T], option: str) -> T:
    from roboprompt_client.errors import InvalidInputError

    try:
        return choose()
    except InvalidInputError as error:
        raise typer.BadParameter(str(error), param_hint=option) from error
