"""What `roboprompt eval` is to run, from its options; each refusal names the option and what would be valid."""

import json
import math
import sys
from collections.abc import Callable, Mapping
from typing import TypeVar

import typer
from rich.console import Console
from rich.progress import Progress

from app.cli.evaluate_options import EPISODES, PAPER, EvaluateOptions
from app.cli.shared import check_names
from app.evaluation.costs import prices_of
from app.evaluation.failures import NotConfirmedError, UnknownWorldError
from app.evaluation.methods import Method, with_noise, with_poses, with_shift
from app.evaluation.panda import Panda
from app.evaluation.paper_sweep import Estimate, PaperSweep, estimate_table
from app.evaluation.paper_tables import limited, paper_plan, paper_tables
from app.evaluation.plan import Plan
from app.evaluation.sweep_run import SweepRun
from app.evaluation.sweeps import SWEEPS, chosen
from app.evaluation.world import World, world_named
from app.settings import Settings
from app.sim.shift import can_shift
from app.sim.tasks import ALL_TASKS
from roboprompt_client.errors import InvalidInputError

T = TypeVar("T")


def sweep_of(asked: EvaluateOptions) -> SweepRun:
    """A sweep of `app.evaluation.sweeps`."""
    given = {"--table": asked.table, "--price-in": asked.price_in, "--price-out": asked.price_out}
    _refuse({**given, "--budget": asked.budget is not None, "--yes": asked.yes}, f"is for --sweep {PAPER} alone")
    plan = _plan(asked)
    llm = Settings() if any(method.source == "voxposer" for method in plan.methods) else None
    return SweepRun(asked.sweep_name, plan, asked.folder, asked.ray, asked.url, asked.report, llm)


def paper_of(asked: EvaluateOptions, console: Console, progress: Progress) -> PaperSweep:
    """The paper's tables.

    Args:
        progress: pauses while the estimate is shown and agreed to.
    """
    _check_paper_options(asked)
    models, read, written = asked.model or [], asked.price_in or [], asked.price_out or []
    prices = _refusing(lambda: prices_of(models, read, written), "--price-in, --price-out")
    every = {table.name: table for table in paper_tables(tuple(dict.fromkeys(models)))}
    check_names("--table", asked.table or (), every)
    wanted = [table for name, table in every.items() if not asked.table or name in asked.table]
    tables = limited(wanted, asked.task, asked.episodes)
    if not tables:
        _refuse({"--task": asked.task}, f"is in none of the tables {', '.join(table.name for table in wanted)}")
    seed = Panda.first_test_seed if asked.seed is None else asked.seed
    plan = paper_plan(tables, asked.demos, asked.command, asked.at_once, seed)

    def confirm(estimate: Estimate) -> None:
        progress.stop()
        _confirm(estimate, asked, console)
        progress.start()

    return PaperSweep(
        PAPER,
        plan,
        asked.folder,
        asked.ray,
        wants_report=asked.report,
        confirm=confirm,
        prices=prices,
        budget=asked.budget,
    )


def _confirm(estimate: Estimate, asked: EvaluateOptions, console: Console) -> None:
    """Show the estimate and ask whether to go on.

    Raises:
        NotConfirmedError: if not, or if there is no terminal to ask at.
    """
    console.print(estimate_table(estimate))
    if asked.yes:
        return
    if not sys.stdin.isatty():
        raise NotConfirmedError("no LLM was asked: there is no terminal to agree to this estimate at; --yes agrees")
    if not typer.confirm("Ask the LLM?", err=True):
        raise NotConfirmedError("no LLM was asked")


def _check_paper_options(asked: EvaluateOptions) -> None:
    settled = {
        "--method": asked.method,
        "--noise": asked.noise is not None,
        "--noise-on": asked.noise_on != "both",
        "--shift": asked.shift is not None,
        "--poses": asked.poses != "given",
        "--recordings": asked.recordings != "rests",
        "--record-hz": asked.record_hz is not None,
        "--world": asked.world,
        "--settings": asked.settings,
    }
    _refuse(settled, f"does not go with --sweep {PAPER}, whose tables settle it")
    check_names("--task", asked.task or (), ALL_TASKS)
    _refuse({"--url": asked.url}, f"does not go with --sweep {PAPER}: its own service records what the LLM says")
    _refuse({"--model": not asked.model}, f"is missing: --sweep {PAPER} asks a model by its name from GET /models")
    if asked.budget is not None:
        wrong = not (math.isfinite(asked.budget) and asked.budget > 0)
        _refuse({"--budget": wrong}, f"is {asked.budget:g} (valid: a finite amount above 0)")
        _refuse({"--budget": not asked.price_in}, "counts by prices: say --price-in and --price-out")


def _refuse(given: Mapping[str, object], why: str) -> None:
    for option, value in given.items():
        if value:
            raise typer.BadParameter(why, param_hint=option)


def _plan(asked: EvaluateOptions) -> Plan:
    sweep, world = SWEEPS[asked.sweep_name], _world(asked)
    tasks = tuple(dict.fromkeys(asked.task or sweep.tasks or world.tasks))
    check_names("--task", tasks, world.tasks)
    models = asked.model or []
    given = sweep.with_models(models)
    names = asked.method or (("default",) if asked.shift is not None else ())
    methods = _refusing(lambda: chosen(given, names, models), "--method")
    methods = _refusing(lambda: with_noise(methods, asked.noise, asked.noise_on), "--noise")
    if asked.poses == "vision":
        methods = _refusing(lambda: with_poses(methods, "vision"), "--poses")
    if (shift := asked.shift) is not None:
        methods = _refusing(lambda: with_shift(methods, shift), "--shift")
        tasks = _shiftable(tasks, shift, named=bool(asked.task))
    _check_world(asked, methods)
    return Plan(
        tasks,
        methods,
        asked.episodes or EPISODES,
        asked.demos,
        asked.command,
        world,
        predictions_at_once=asked.at_once,
        first_test_seed=world.first_test_seed if asked.seed is None else asked.seed,
        settings=_settings(asked),
    )


def _world(asked: EvaluateOptions) -> World:
    try:
        world = Panda(asked.recordings, num_cameras=asked.cameras) if asked.world is None else world_named(asked.world)
    except UnknownWorldError as error:
        raise typer.BadParameter(str(error), param_hint="--world") from error
    return world if asked.record_hz is None else world.recorded_at(asked.record_hz)


def _check_world(asked: EvaluateOptions, methods: tuple[Method, ...]) -> None:
    """Refuse what only the simulated Panda has in another world, and what means another world on the Panda."""
    if asked.world is None:
        own = any(method.source == "own keyframes" for method in methods)
        _refuse({"--method": own}, "own keyframes: is for another --world; the Panda's is 'replay'")
        return
    _refuse({"--ray": asked.ray, "--recordings": asked.recordings != "rests"}, "is for the simulated Panda alone")
    needing = [method.label for method in methods if method.needs_panda]
    _refuse({"--method": needing}, f"{', '.join(needing)}: needs the simulated Panda")


def _settings(asked: EvaluateOptions) -> dict[str, object]:
    try:
        settings = json.loads(asked.settings or "{}")
    except ValueError as error:
        raise typer.BadParameter(f"is not JSON: {error}", param_hint="--settings") from error
    _refuse(
        {"--settings": not isinstance(settings, dict)}, 'is not an object such as {"keyframes": {"rule": "merged"}}'
    )
    return dict(settings)


def _shiftable(tasks: tuple[str, ...], shift_m: float, *, named: bool) -> tuple[str, ...]:
    """The tasks whose objects can be moved; one that was named must be among them."""
    movable = tuple(name for name in tasks if can_shift(name, shift_m))
    if not movable or (named and movable != tasks):
        fixed = next(name for name in tasks if name not in movable)
        message = f"{fixed}: nothing in its scenes can be moved freely by {shift_m:g} m"
        raise typer.BadParameter(message, param_hint="--shift")
    return movable


def _refusing(choose: Callable[[], T], option: str) -> T:
    try:
        return choose()
    except InvalidInputError as error:
        raise typer.BadParameter(str(error), param_hint=option) from error
