"""Methods that an evaluation compares, and their variants by command-line options."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from roboprompt_client.errors import InvalidInputError

Poses = Literal["given", "vision"]
# Where a method's actions come from; `app.evaluation.trials` has a function for each.
Source = Literal["service", "expert replay", "expert", "robot loop", "own keyframes"]
OF_THE_SERVICE = frozenset[Source]({"service", "robot loop"})
OF_THE_PANDA = frozenset[Source]({"robot loop", "expert replay"})


@dataclass(frozen=True)
class Method:
    """A way to get actions for a scene: one configuration of a sweep.

    Attributes:
        label: its name in tables.
        options: for `POST /predict`.
        settings: for `PUT /tasks/{name}`, in addition to those of the evaluation; methods that differ here use
            different tasks of the service.
        noise: added to poses, of demonstrations and tests, as a multiple of the error in `app.evaluation.paper`.
        poses: whether the service is given the objects' poses, or finds them in images (`app.evaluation.teach`).
        source: where the actions come from; `robot loop` asks the service and lets the robot's own loop carry them out;
            others do not ask it.
        shift_m: how far the free objects are moved between answer and first action; for the `robot loop`.
        look_again: whether the robot then looks again (`roboprompt_client.runs.look_again`).
    """

    label: str
    options: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    noise: float = 0.0
    source: Source = "service"
    poses: Poses = "given"
    shift_m: float = 0.0
    look_again: bool = False

    def __post_init__(self) -> None:
        if self.poses == "vision" and (self.noise or self.source != "service"):
            why = "noise is added to given poses" if self.noise else f"{self.source} takes given poses"
            raise InvalidInputError(f"methods[{self.label}].poses", f"is 'vision', but {why}", "given")

    @property
    def asks_service(self) -> bool:
        """Whether the service is asked for actions."""
        return self.source in OF_THE_SERVICE

    @property
    def needs_panda(self) -> bool:
        """Whether only the simulated Panda can run it."""
        return self.source in OF_THE_PANDA or self.shift_m > 0


def with_noise(methods: Iterable[Method], scale: float) -> tuple[Method, ...]:
    """Return the methods with noise on observed poses; methods that observe no poses are unchanged.

    Args:
        scale: in multiples of the paper's errors.

    Raises:
        InvalidInputError: if the scale is negative or not finite, or for a method with noise of its own or with poses
            from images.
    """
    if not (math.isfinite(scale) and scale >= 0):
        raise InvalidInputError("noise", f"is {scale}", "a finite number, 0 or above")
    if own := next((method for method in methods if method.noise), None):
        why = f"is {scale:g}, but {own.label!r} has a noise of {own.noise:g} of its own"
        raise InvalidInputError("noise", why, "another sweep, or --method with methods that set none")
    return tuple(replace(method, noise=scale) if method.asks_service else method for method in methods)


def with_shift(methods: Iterable[Method], shift_m: float) -> tuple[Method, ...]:
    """Return each method, with free objects that move after the answer, twice: without and with looking again.

    Raises:
        InvalidInputError: if the shift is not above 0, or for methods that do not ask the service with given poses.
    """
    if not (math.isfinite(shift_m) and shift_m > 0):
        raise InvalidInputError("shift", f"is {shift_m:g} m", "a finite distance above 0")
    pairs: list[Method] = []
    for method in methods:
        if method.source != "service" or method.poses != "given":
            message = f"{method.label!r} does not ask the service with given poses"
            raise InvalidInputError("shift", message, "methods that do: default, nearest, regression")
        again = "look again" if method.label == "default" else f"{method.label}, look again"
        shifted = replace(method, source="robot loop", shift_m=shift_m)
        pairs += [shifted, replace(shifted, label=again, look_again=True)]
    return tuple(pairs)


def with_poses(methods: Iterable[Method], poses: Poses) -> tuple[Method, ...]:
    """Return the methods with this source of poses; methods that do not ask the service are unchanged.

    Raises:
        InvalidInputError: for a method that needs given poses.
    """
    return tuple(replace(method, poses=poses) if method.asks_service else method for method in methods)


def with_models(methods: Iterable[Method], models: Sequence[str]) -> tuple[Method, ...]:
    """Return the methods once for each model; those that name a model or ask none are unchanged.

    Args:
        models: if empty, the service chooses.
    """
    crossed: list[Method] = []
    for method in methods:
        if not method.asks_service or "model" in method.options or not models:
            crossed.append(method)
            continue
        for model in models:
            label = f"{method.label}, {model}" if len(models) > 1 else method.label
            crossed.append(replace(method, label=label, options={**method.options, "model": model}))
    return tuple(crossed)
