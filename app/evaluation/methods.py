"""Methods that evaluations compare, their variants by command-line options, and the named sweeps that compare them.

To add a sweep, add an entry to `SWEEPS`.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from app.sim.tasks import COMPOSITION_TASKS, TASKS
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


def with_noise(methods: Sequence[Method], scale: float) -> tuple[Method, ...]:
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


BY_NAME = Method("")  # a model as the service asks it
PAPER = {"representation": "absolute", "prompt_format": "paper", "system_prompt": "a"}
LONG_PLAN_S = 600.0
# A yardstick shows what its actions are worth; checked against the demonstrations, most of them would be refused.
REGRESSION = Method("regression, no LLM", {"model": "regression", "unsupported": "allow"})
COPY = Method("nearest demonstration's rows, no LLM", {"model": "nearest"})
OWN_KEYFRAMES = Method("own keyframes", source="own keyframes")
REPLAY = Method("expert replay", source="expert replay")
EXPERT = Method("expert", source="expert")

# What a method can be called beside the labels of a sweep
SIMPLE_NAMES: Mapping[str, Method] = {
    "default": Method("default"),
    "nearest": COPY,
    "regression": REGRESSION,
    "sums": Method("absolute rows as sums", {**PAPER, "prompt_format": "sums", "timeout_s": LONG_PLAN_S}),
    "replay": REPLAY,
    "expert": EXPERT,
}
INTERVALS = (5, 10, 20, 40, 80)  # frames; paper, section V "Keyframe extraction"
DEMONSTRATIONS = (1, 2, 5, 10, 15)
NOISE = (0.5, 1.0, 1.5, 2.0)  # paper, section V "Robustness to pose estimation error"
EMBEDDED = "embedded/gemma-3-270m"
# An episode of 10 s at 20 Hz has 40 actions at an interval of 5 frames, 15 more than the service allows by default.
LONG_REPLIES = {"max_actions": 100, "timeout_s": 300.0}
# How the yardstick of compositions asks, so that it measures the model: what no demonstration shows is not refused, and
# each demonstration is shown as it was recorded. By itself a task averages rows that scatter, and with them what the
# scene decides. See docs/composition.md.
ALLOWED = {"unfamiliar": "allow", "unsupported": "allow"}
AS_RECORDED = {"keyframes": {"rule": "merged"}}
OPEN = Method("", {**PAPER, **ALLOWED, "timeout_s": LONG_PLAN_S}, AS_RECORDED)


def chosen(methods: Sequence[Method], names: Sequence[str], models: Sequence[str]) -> tuple[Method, ...]:
    """The methods that are asked for by name, in that order; all if none are.

    Args:
        methods: of a sweep, with its models.
        names: labels of `methods`, or simple ones.
        models: for those that a simple name stands for; see `with_models`.

    Raises:
        InvalidInputError: naming the names that there are.
    """
    by_label = {method.label: method for method in methods}
    found: dict[str, Method] = {} if names else by_label
    for name in names:
        if name not in by_label and name not in SIMPLE_NAMES:
            valid = ", ".join(map(repr, dict.fromkeys([*by_label, *SIMPLE_NAMES])))
            raise InvalidInputError("method", f"{name!r} is neither a label of the sweep nor a simple name", valid)
        label = name if name in by_label else SIMPLE_NAMES[name].label
        named = (by_label[label],) if label in by_label else with_models((SIMPLE_NAMES[name],), models)
        found.update((method.label, method) for method in named)
    return tuple(found.values())


def methods_beside(model: str | None) -> tuple[Method, ...]:
    """Return the model's method, and methods to compare it with: the paper's format, a regression, the expert's replay.

    Args:
        model: a name from `GET /models`; None: the service's default, which is not asked in the paper's format as well:
            that is beyond a model so small (0 of 20, docs/results/formats), and would take most of the time.
    """
    options = {} if model is None else {"model": model}
    label = f"{model or 'default LLM'}, its representation"
    # As a yardstick, see REGRESSION; nor did the paper ask twice.
    paper = Method("the same LLM, paper's format", {**options, **PAPER, "unsupported": "allow"})
    return Method(label, options), *([paper] if model else []), REGRESSION, REPLAY


@dataclass(frozen=True)
class Sweep:
    """Methods to compare on the same scenes.

    Attributes:
        about: one line for people.
        models: compared beside those that are asked for; empty where models are not what is compared.
        asked: how they are asked; its label is each model's name.
        tasks: which are evaluated unless others are asked for; none: all of the world.
    """

    about: str
    methods: tuple[Method, ...] = ()
    models: tuple[str, ...] = ()
    asked: Method = BY_NAME
    tasks: tuple[str, ...] = tuple(TASKS)

    def with_models(self, given: Sequence[str]) -> tuple[Method, ...]:
        """The methods with the models that are asked for, if any."""
        models = dict.fromkeys([*self.models, *given] if self.models else [])
        asked = [replace(self.asked, label=name, options={"model": name, **self.asked.options}) for name in models]
        return (*asked, *with_models(self.methods, given))


def _openly(method: Method) -> Method:
    return replace(method, options={**method.options, **ALLOWED}, settings=AS_RECORDED)


def _uniform(interval: int) -> Method:
    keyframes = {"rule": "uniform", "interval": interval}
    return Method(f"uniform {interval}", LONG_REPLIES, settings={"keyframes": keyframes})


SWEEPS: Mapping[str, Sweep] = {
    "main": Sweep(
        "the default method against methods without an LLM, and against the expert's replay",
        (Method("default"), COPY, REGRESSION, REPLAY),
    ),
    "formats": Sweep(
        "rows relative to objects against the paper's and the authors' formats, and against action tokens",
        (
            Method("object_frame", {"representation": "object_frame"}),
            Method("absolute, paper", PAPER),
            Method("absolute, authors", {**PAPER, "prompt_format": "authors"}),
            Method("action tokens in the paper's prompt", {**PAPER, "representation": "action_tokens"}),
        ),
    ),
    "keyframes": Sweep(
        "keyframes against uniform sampling",
        (Method("keyframes", LONG_REPLIES), *(_uniform(interval) for interval in INTERVALS)),
    ),
    "demonstrations": Sweep(
        "the number of demonstrations",
        tuple(Method(f"{number} demonstrations", {"num_demonstrations": number}) for number in DEMONSTRATIONS),
    ),
    "noise": Sweep(
        "noise on object poses, in multiples of 1.68 cm and 4.61 degrees",
        (Method("no noise"), *(Method(f"noise x {scale:g}", noise=scale) for scale in NOISE)),
    ),
    "poses": Sweep(
        "poses given against poses found in images, by models learned from six labeled scenes",
        (Method("given poses"), Method("poses from images", poses="vision"), REPLAY),
    ),
    "experts": Sweep(
        "the scripted experts, and their keyframes after binning: the ceiling of every other method; asks no LLM",
        (EXPERT, REPLAY),
    ),
    "outside": Sweep(
        "a world that others have made: demonstrations' own keyframes in their own scenes, and models",
        (OWN_KEYFRAMES,),
        ("nearest", "regression", EMBEDDED),
        tasks=(),
    ),
    "composition": Sweep(
        "tasks whose tests ask for combinations that no demonstration shows, so that copying fails; `default` as the"
        " service refuses by itself, all others with everything allowed",
        (
            Method("default", {"timeout_s": LONG_PLAN_S}),
            _openly(COPY),
            _openly(REGRESSION),
            _openly(Method("parts", {"representation": "parts", "timeout_s": LONG_PLAN_S})),
            REPLAY,
        ),
        (EMBEDDED,),
        OPEN,
        tuple(COMPOSITION_TASKS),
    ),
}
