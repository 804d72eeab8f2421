"""`roboprompt eval`: how well methods do on unseen scenes of many tasks.

Each refusal names the option and what is valid.
"""

import inspect
import json
import shlex
import sys
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

import typer
from rich.console import Console

from app.cli.shared import INTERRUPTED, check_models, check_names, errors_printed, progress_bars, service_at
from app.evaluation.methods import SIMPLE_NAMES, SWEEPS, Method, chosen, with_noise, with_poses, with_shift
from app.evaluation.plan import Plan
from app.evaluation.sweep_run import SweepResult, SweepRun
from app.evaluation.tables import results_table, sweep_summary
from app.evaluation.world import Panda, World, world_named
from app.sim.shift import can_shift
from roboprompt_client.errors import InvalidInputError

METHOD_NAMES = ", ".join(SIMPLE_NAMES)
OUTSIDE = "outside"
EPISODES = 25
Option = typer.Option
PACE_S = 600.0  # the time left follows from the pace of the last ten minutes: methods differ in theirs
MAX_ERRORS = 5  # kinds of errors that the terminal shows; table.md has all


@dataclass(frozen=True)
class EvaluateOptions:
    """The options of the command, each in one place: its name, type, help and default."""

    sweep: Annotated[str | None, Option(help=f"{', '.join(SWEEPS)}; default: main, with --world outside")] = None
    task: Annotated[list[str] | None, Option(help="may be repeated; default: all of the sweep")] = None
    episodes: Annotated[int, Option(min=1, help="unseen scenes per task")] = EPISODES
    demos: Annotated[int, Option(min=1, max=100, help="demonstrations in a prompt")] = 10
    model: Annotated[
        list[str] | None, Option(help="a name from GET /models; may be repeated; default: the service's")
    ] = None
    poses: Annotated[
        Literal["given", "vision"], Option(help="vision: images only, by object models learned beforehand")
    ] = "given"
    cameras: Annotated[int, Option(min=1, max=3, help="that take images, of the simulated Panda")] = 2
    method: Annotated[
        list[str] | None,
        Option(help=f"a label of the sweep, or one of {METHOD_NAMES}; may be repeated; default: all of the sweep"),
    ] = None
    recordings: Annotated[
        Literal["rests", "continuous"],
        Option(help="demonstrations that rest at every pose, or pass them as a person does"),
    ] = "rests"
    world: Annotated[
        str | None,
        Option(help="module with a WORLD, e.g. benchmarks.metaworld.world; default: the simulated Panda"),
    ] = None
    settings: Annotated[
        str | None, Option(help='JSON for PUT /tasks of every task, e.g. {"keyframes": {"rule": "merged"}}')
    ] = None
    seed: Annotated[
        int | None,
        Option(
            min=0,
            help="of the first unseen scene, others follow (default: 100000; of another world: its own). Other seeds"
            " give other scenes than the published ones. Demonstrations keep their seeds, 0, 1, 2, ..., but for those"
            " that are tested",
        ),
    ] = None
    noise: Annotated[
        float | None,
        Option(
            min=0,
            help="on given poses, in multiples of 1.68 cm and 4.61 degrees; default: the sweep's own",
        ),
    ] = None
    shift: Annotated[
        float | None,
        Option(
            help="meters: move the free objects after the answer, and test with and without looking again"
            " (methods `default` and `look again`; default: they stay)"
        ),
    ] = None
    out: Annotated[Path | None, Option(help="folder of the results (default: reports/eval-SWEEP-TIME)")] = None
    url: Annotated[str | None, Option(help="of a running service, instead of one of its own")] = None
    as_json: Annotated[bool, Option("--json", help="one JSON object as the last line")] = False

    @property
    def sweep_name(self) -> str:
        """The sweep that is asked for, or that suits the world."""
        return self.sweep or ("main" if self.world is None else OUTSIDE)

    @cached_property
    def folder(self) -> Path:
        """The folder of the results."""
        return self.out or Path("reports") / f"eval-{self.sweep_name}-{datetime.now():%Y%m%d-%H%M%S}"

    @property
    def command(self) -> str:
        """The command line that continues the run."""
        return shlex.join(["roboprompt", *sys.argv[1:], *([] if self.out else ["--out", str(self.folder)])])


def evaluate(**options: Any) -> None:  # noqa: ANN401
    """Teach tasks to the service, test methods on unseen scenes, and compare them with the paper's numbers.

    Results are kept as they come: the same command with the same --out continues where an earlier one stopped.
    """
    asked = EvaluateOptions(**options)
    check_names("--sweep", [asked.sweep_name], SWEEPS)
    console = Console(stderr=asked.as_json)
    try:
        plan = _plan(asked)
    except InvalidInputError as error:
        raise typer.BadParameter(str(error), param_hint=f"--{error.field.rpartition('.')[2]}") from error
    if asked.url is None:
        check_models(asked.model or ())
    else:
        with service_at(asked.url) as client:
            client.ping()
    with errors_printed(), progress_bars(console, PACE_S) as progress:
        result = SweepRun(asked.sweep_name, plan, asked.folder, asked.url)(progress)
    _print_results(console, result, asked)
    if asked.as_json:
        scenes = {"recordings": asked.recordings, "seed": plan.first_test_seed, "episodes": plan.episodes}
        known = {"sweep": asked.sweep_name, "out": str(asked.folder), **scenes}
        ended = {"remaining": result.remaining, "stopped": result.stopped}
        print(json.dumps({**known, **sweep_summary(result.evaluation), **ended}))  # noqa: T201
    if result.remaining:
        raise typer.Exit(INTERRUPTED if result.stopped == "interrupted" else 1)


# Typer reads a command's options from its signature.
evaluate.__signature__ = inspect.signature(EvaluateOptions)  # type: ignore[attr-defined]
evaluate.__annotations__ = get_type_hints(EvaluateOptions, include_extras=True)


def _print_results(console: Console, result: SweepResult, asked: EvaluateOptions) -> None:
    console.print(results_table(result.evaluation))
    errors = [f"error in {number} trials: {message}" for message, number in result.evaluation.errors()]
    rest = [f"{result.stopped or 'errors'}: {result.remaining} trials remain; go on with:", asked.command]
    lines = [f"results: {asked.folder}", *errors[:MAX_ERRORS], *(rest if result.remaining else [])]
    console.print(*lines, sep="\n", markup=False, highlight=False, soft_wrap=True)


def _plan(asked: EvaluateOptions) -> Plan:
    """Return the plan of the options.

    Raises:
        InvalidInputError: naming the option, and what is valid.
    """
    sweep, models = SWEEPS[asked.sweep_name], asked.model or []
    world = Panda(asked.recordings, num_cameras=asked.cameras) if asked.world is None else world_named(asked.world)
    tasks = tuple(dict.fromkeys(asked.task or sweep.tasks or world.tasks))
    check_names("--task", tasks, world.tasks)
    names = asked.method or (("default",) if asked.shift is not None else ())
    methods = chosen(sweep.with_models(models), names, models)
    if asked.noise is not None:
        methods = with_noise(methods, asked.noise)
    if asked.poses == "vision":
        methods = with_poses(methods, "vision")
    if asked.shift is not None:
        methods = with_shift(methods, asked.shift)
        tasks = _shiftable(tasks, asked.shift, named=bool(asked.task))
    _check_world(asked, world, methods)
    seed = world.first_test_seed if asked.seed is None else asked.seed
    settings = _settings(asked.settings or "{}")
    return Plan(tasks, methods, asked.episodes, asked.demos, asked.command, world, False, seed, settings)


def _check_world(asked: EvaluateOptions, world: World, methods: tuple[Method, ...]) -> None:
    """Refuse options of the simulated Panda in another world, and options of other worlds on the Panda."""
    if asked.world is None:
        if any(method.source == "own keyframes" for method in methods):
            raise InvalidInputError("method", "own keyframes: is for another --world; the Panda's is 'replay'")
    elif asked.recordings != "rests":
        raise InvalidInputError("recordings", "is for the simulated Panda alone")
    elif needing := [method.label for method in methods if method.needs_panda]:
        raise InvalidInputError("method", f"{', '.join(needing)}: needs the simulated Panda")
    elif not world.has_cameras and (looking := [method.label for method in methods if method.poses == "vision"]):
        raise InvalidInputError("method", f"{', '.join(looking)}: {asked.world} has no cameras")


def _settings(text: str) -> dict[str, object]:
    try:
        settings = json.loads(text)
    except ValueError as error:
        raise InvalidInputError("settings", f"is not JSON: {error}") from error
    if not isinstance(settings, dict):
        raise InvalidInputError("settings", 'is not an object such as {"keyframes": {"rule": "merged"}}')
    return settings


def _shiftable(tasks: tuple[str, ...], shift_m: float, *, named: bool) -> tuple[str, ...]:
    """Return the tasks whose objects can be moved; one that was named must be among them."""
    movable = tuple(name for name in tasks if can_shift(name, shift_m))
    if not movable or (named and movable != tasks):
        fixed = next(name for name in tasks if name not in movable)
        raise InvalidInputError("shift", f"{fixed}: nothing in its scenes can be moved freely by {shift_m:g} m")
    return movable
