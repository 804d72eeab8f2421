"""What a method is, and the variants of methods that options ask for."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from app.llm.baselines import YARDSTICKS
from roboprompt_client.errors import InvalidInputError

# Where a method's actions come from; `app.evaluation.trials` has the function for each.
Poses = Literal["given", "vision"]
NoiseOn = Literal["both", "test"]
Source = Literal[
    "service",
    "closed loop",
    "nearest demonstration",
    "expert replay",
    "expert",
    "robot loop",
    "own keyframes",
    "voxposer",
    "voxposer oracle",
]
OF_THE_SERVICE = frozenset[Source]({"service", "closed loop", "robot loop"})
OF_THE_PANDA = frozenset[Source]({"closed loop", "robot loop", "expert replay", "voxposer oracle"})


@dataclass(frozen=True)
class Method:
    """A way to get from a scene to actions: one configuration of a sweep.

    Attributes:
        label: how tables name it.
        options: for `POST /predict`.
        settings: for `PUT /tasks/{name}`, beside those of every evaluation; methods that differ here are taught under
            different task names.
        noise: added to poses, as a multiple of the error in `app.evaluation.paper`.
        noise_on: whether it is added to the poses of demonstrations and tests, or of tests alone.
        poses: whether the service is given the objects' poses, or finds them in images (`app.evaluation.teach`).
        stored: episodes that the task must have for the service to choose from, if more than it shows.
        source: where the actions come from; `closed loop` asks the service for one at a time, `robot loop` once for
            all, and the robot carries them out one by one; others do not ask it.
        shift_m: how far the free objects are moved between answer and first action; for the `robot loop`.
        look_again: whether the robot then looks again (`roboprompt_client.runs.look_again`).
        lead_s: where objects move by themselves, how far ahead the robot then aims (`roboprompt_client.runs.leading`).
    """

    label: str
    options: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    noise: float = 0.0
    source: Source = "service"
    poses: Poses = "given"
    stored: int = 0
    noise_on: NoiseOn = "both"
    shift_m: float = 0.0
    look_again: bool = False
    lead_s: float = 0.0

    def __post_init__(self) -> None:
        if self.poses == "vision" and (self.noise or self.source != "service"):
            why = "noise is added to given poses" if self.noise else f"{self.source} takes given poses"
            raise InvalidInputError(f"methods[{self.label}].poses", f"is 'vision', but {why}", "given")

    @property
    def asks_service(self) -> bool:
        """Whether the service is asked for actions."""
        return self.source in OF_THE_SERVICE

    @property
    def asks_model(self) -> bool:
        """Whether an LLM is asked, by the service or directly."""
        return self.asks_service or self.source == "voxposer"

    @property
    def is_yardstick(self) -> bool:
        """Whether models are held against it: no LLM has a part in its actions."""
        return not self.asks_model or self.options.get("model") in YARDSTICKS

    @property
    def sees_poses(self) -> bool:
        """Whether the actions depend on where objects are seen."""
        return self.asks_model or self.source in ("nearest demonstration", "voxposer oracle")

    @property
    def needs_panda(self) -> bool:
        """Whether it uses what only the simulated Panda has."""
        return self.source in OF_THE_PANDA or self.poses == "vision" or self.shift_m > 0

    @property
    def taught_noise(self) -> float:
        """The noise on the poses of demonstrations."""
        return self.noise if self.noise_on == "both" else 0.0


def with_noise(methods: Iterable[Method], scale: float | None, on: NoiseOn) -> tuple[Method, ...]:
    """The methods with noise on the poses that they see; those that see none stay as they are.

    Args:
        scale: in multiples of the paper's errors; None: each method's own.

    Raises:
        InvalidInputError: if the scale is no size, if a method that sets its noise itself is given another, or if one
            finds poses in images.
    """
    if scale is not None and not (math.isfinite(scale) and scale >= 0):
        raise InvalidInputError("noise", f"is {scale}", "a finite number, 0 or above")
    noisy: list[Method] = []
    for method in methods:
        if scale is not None and method.noise:
            why = f"is {scale:g}, but {method.label!r} has a noise of {method.noise:g} of its own"
            raise InvalidInputError("noise", why, "another sweep, or --method with methods that set none")
        size = method.noise if scale is None else scale
        noisy.append(replace(method, noise=size, noise_on=on) if method.sees_poses and size else method)
    return tuple(noisy)


def with_shift(methods: Iterable[Method], shift_m: float) -> tuple[Method, ...]:
    """Each method in scenes whose free objects are moved after the answer, and beside it the same looking again.

    Raises:
        InvalidInputError: if the shift is no distance, or for methods whose actions the robot's loop does not ask for.
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
    """The methods with the service finding poses in the given way; those that do not ask it stay as they are.

    Raises:
        InvalidInputError: for a method that needs given poses.
    """
    return tuple(replace(method, poses=poses) if method.asks_service else method for method in methods)


def with_models(methods: Iterable[Method], models: Sequence[str]) -> tuple[Method, ...]:
    """The methods with each of the models in turn; those that name a model or ask none stay as they are.

    Args:
        models: none leaves the choice to the service.
    """
    crossed: list[Method] = []
    for method in methods:
        if not method.asks_model or "model" in method.options or not models:
            crossed.append(method)
            continue
        for model in models:
            label = f"{method.label}, {model}" if len(models) > 1 else method.label
            crossed.append(replace(method, label=label, options={**method.options, "model": model}))
    return tuple(crossed)
