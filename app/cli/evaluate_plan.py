"""The plan of `roboprompt eval` from its options; each refusal names the option and what is valid."""

import json
from collections.abc import Callable, Mapping
from typing import TypeVar

import typer

from app.cli.evaluate import EvaluateOptions
from app.cli.shared import check_names
from app.evaluation.failures import UnknownWorldError
from app.evaluation.methods import Method, with_noise, with_poses, with_shift
from app.evaluation.panda import Panda
from app.evaluation.plan import Plan
from app.evaluation.sweep_run import SweepRun
from app.evaluation.sweeps import SWEEPS, chosen
from app.evaluation.world import World, world_named
from app.sim.shift import can_shift
from roboprompt_client.errors import InvalidInputError

T = TypeVar("T")


def sweep_of(asked: EvaluateOptions) -> SweepRun:
    """A sweep of `app.evaluation.sweeps`."""
    return SweepRun(asked.sweep_name, _plan(asked), asked.folder, asked.url, asked.report)


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
        asked.episodes,
        asked.demos,
        asked.command,
        world,
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
    _refuse({"--recordings": asked.recordings != "rests"}, "is for the simulated Panda alone")
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
