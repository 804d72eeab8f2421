"""`roboprompt eval`: how well methods do on unseen scenes of many tasks."""

import json
import shlex
import sys
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from app.cli.shared import check_models, check_names, check_service

if TYPE_CHECKING:
    from app.evaluation.plan import Plan
    from app.evaluation.results import Method
    from app.evaluation.sweep_run import SweepResult

SWEEP_NAMES = "main, formats, keyframes, demonstrations, selection, system_prompts, noise, poses, experts, loop, models"
METHOD_NAMES = "default, nearest, regression, replay, expert"
PACE_S = 600.0  # the time left follows from the pace of the last ten minutes: methods differ in theirs
MAX_ERRORS = 5  # kinds of errors that the terminal shows; table.md has all
INTERRUPTED = 130  # the exit status of a program that Ctrl-C ended


def evaluate(
    sweep: Annotated[str, typer.Option(help=SWEEP_NAMES)] = "main",
    task: Annotated[list[str] | None, typer.Option(help="may be repeated; default: all")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="unseen scenes a task")] = 25,
    demos: Annotated[int, typer.Option(min=1, max=100, help="demonstrations in a prompt")] = 10,
    model: Annotated[
        list[str] | None, typer.Option(help="a name from GET /models; may be repeated; default: the service's")
    ] = None,
    poses: Annotated[
        Literal["given", "vision"], typer.Option(help="vision: images only, by object models learned beforehand")
    ] = "given",
    method: Annotated[
        list[str] | None,
        typer.Option(
            help=f"a label of the sweep, or one of {METHOD_NAMES}; may be repeated; default: all of the sweep"
        ),
    ] = None,
    recordings: Annotated[
        Literal["rests", "continuous"],
        typer.Option(help="demonstrations that rest at every pose, or pass them as a person does"),
    ] = "rests",
    seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="of the first unseen scene, others follow: other than 100000 gives other scenes than the published"
            " ones. Demonstrations keep their seeds, 0, 1, 2, ..., but for those that are tested",
        ),
    ] = 100_000,
    noise: Annotated[
        float | None,
        typer.Option(min=0, help="on given poses, in multiples of 1.68 cm and 4.61 degrees; default: the sweep's own"),
    ] = None,
    noise_on: Annotated[
        Literal["both", "test"], typer.Option(help="noise on demonstrations and tests, or on tests alone")
    ] = "both",
    shift: Annotated[
        float | None,
        typer.Option(
            help="metres: move the free objects after the answer, and test with and without looking again"
            " (methods `default` and `look again`; default: nobody moves anything)"
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="folder of the results (default: reports/eval-SWEEP-TIME)")] = None,
    ray: Annotated[
        str | None, typer.Option(help="run on the Ray cluster at this address, 'auto', or 'local' to start one")
    ] = None,
    url: Annotated[str | None, typer.Option(help="of a running service, instead of one of its own")] = None,
    at_once: Annotated[int, typer.Option(min=1, help="predictions asked for at a time")] = 1,
    report: Annotated[bool, typer.Option(help="a page with prompt, reply and pictures of failures")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object as the last line")] = False,
) -> None:
    """Teach tasks to the service, test methods on unseen scenes, and hold them against the paper's numbers.

    Results are kept as they come: the same command with the same --out goes on where an earlier one stopped.
    """
    # The simulator is an extra that `roboprompt serve` does without.
    from app.evaluation.failures import EvaluationError
    from app.evaluation.methods import SWEEPS, chosen, with_noise, with_poses, with_shift
    from app.evaluation.plan import Plan
    from app.evaluation.sweep_run import SweepRun
    from app.sim.tasks import TASKS
    from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError

    check_names("--sweep", [sweep], SWEEPS)
    check_names("--task", task or (), TASKS)
    folder = out or Path("reports") / f"eval-{sweep}-{datetime.now():%Y%m%d-%H%M%S}"
    command = shlex.join(["roboprompt", *sys.argv[1:], *([] if out else ["--out", str(folder)])])
    given = SWEEPS[sweep].with_models(model or ())
    names = method or (("default",) if shift is not None else ())
    methods = _refusing(lambda: chosen(given, names, model or ()), "--method")
    methods = _refusing(lambda: with_noise(methods, noise, noise_on), "--noise")
    if poses == "vision":
        methods = _refusing(lambda: with_poses(methods, "vision"), "--poses")
    tasks = tuple(dict.fromkeys(task or TASKS))
    if shift is not None:
        methods = _refusing(lambda: with_shift(methods, shift), "--shift")
        tasks = _shiftable(tasks, shift, named=task is not None)
    plan = Plan(
        tasks,
        methods,
        episodes,
        demos,
        command,
        predictions_at_once=at_once,
        recordings=recordings,
        first_test_seed=seed,
    )
    if url is not None:
        check_service(url)
    check_models(model or (), url)
    console = Console(stderr=as_json)
    try:
        with _progress(console) as progress:
            result = SweepRun(sweep, plan, folder, ray, url, report)(progress)
    except (EvaluationError, ServiceUnreachableError, ServiceProblemError, ConnectionError) as error:
        _say(console, [str(error)])
        raise typer.Exit(1) from error
    _tell(console, result, folder, command)
    if as_json:
        print(json.dumps({"sweep": sweep, "out": str(folder), **_scenes(plan), **result.summary()}))  # noqa: T201
    if result.remaining:
        raise typer.Exit(INTERRUPTED if result.stopped == "interrupted" else 1)


def _shiftable(tasks: tuple[str, ...], shift_m: float, *, named: bool) -> tuple[str, ...]:
    """The tasks whose objects can be moved; one that was named must be among them."""
    from app.sim.shift import can_shift

    movable = tuple(name for name in tasks if can_shift(name, shift_m))
    if not movable or (named and movable != tasks):
        fixed = next(name for name in tasks if name not in movable)
        message = f"{fixed}: nothing in its scenes can be moved freely by {shift_m:g} m"
        raise typer.BadParameter(message, param_hint="--shift")
    return movable


def _scenes(plan: "Plan") -> dict[str, object]:
    """How demonstrations were recorded, and which scenes were tested, for programs."""
    return {"recordings": plan.recordings, "seed": plan.first_test_seed, "episodes": plan.episodes}


def _refusing(choose: Callable[[], tuple["Method", ...]], option: str) -> tuple["Method", ...]:
    from roboprompt_client.errors import InvalidInputError

    try:
        return choose()
    except InvalidInputError as error:
        raise typer.BadParameter(str(error), param_hint=option) from error


def _tell(console: Console, result: "SweepResult", folder: Path, command: str) -> None:
    from app.evaluation.result_tables import terminal_table
    from app.evaluation.scores import errors_of

    console.print(terminal_table(result.evaluation, console.width))
    errors = [f"error in {number} trials: {message}" for message, number in errors_of(result.evaluation)]
    rest = [f"{result.stopped or 'errors'}: {result.remaining} trials remain; go on with:", command]
    _say(console, [f"results: {folder}", *errors[:MAX_ERRORS], *(rest if result.remaining else [])])


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
