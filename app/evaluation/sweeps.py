"""The named sweeps: which methods are held against each other. To add one, add an entry."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.evaluation.methods import COPY, KAT, NEAREST, PAPER, REGRESSION, with_models
from app.evaluation.records import EXPERT, REPLAY, Method

INTERVALS = (5, 10, 20, 40, 80)  # frames; paper, section V "Keyframe extraction"
DEMONSTRATIONS = (1, 2, 5, 10, 15)
SYSTEM_PROMPTS = ("a", "b", "c")  # paper, supplement "Different system prompts"
SELECTIONS = ("first", "diverse", "nearest")
STORED = 30
NOISE = (0.5, 1.0, 1.5, 2.0)  # paper, section V "Robustness to pose estimation error"
EMBEDDED = ("embedded/gemma-3-270m", "embedded/smollm2-135m")
# An episode of 10 s at 20 Hz has 40 actions at an interval of 5 frames, 15 more than the service allows by default.
LONG_REPLIES = {"max_actions": 100, "timeout_s": 300.0}


@dataclass(frozen=True)
class Sweep:
    """Methods to compare on the same scenes.

    Attributes:
        about: one line for people.
        models: compared beside those that are asked for; empty where models are not what is compared.
    """

    about: str
    methods: tuple[Method, ...] = ()
    models: tuple[str, ...] = ()

    def with_models(self, given: Sequence[str]) -> tuple[Method, ...]:
        """The methods with the models that are asked for, if any."""
        if self.models:
            return tuple(Method(model, {"model": model}) for model in dict.fromkeys([*self.models, *given]))
        return with_models(self.methods, given)


def _uniform(interval: int) -> Method:
    keyframes = {"rule": "uniform", "interval": interval}
    return Method(f"uniform {interval}", LONG_REPLIES, settings={"keyframes": keyframes})


def _selected(selection: str, shown: int) -> Method:
    options = {"selection": selection, "num_demonstrations": shown}
    return Method(f"{shown} {selection} of {STORED}", options, noise=1.0, stored=STORED)


SWEEPS: Mapping[str, Sweep] = {
    "main": Sweep(
        "the default method against methods without an LLM, and against the expert's replay",
        (Method("default"), COPY, REGRESSION, NEAREST, REPLAY),
    ),
    "formats": Sweep(
        "rows relative to objects against the paper's and the authors' formats, and against KAT's action tokens",
        (
            Method("object_frame", {"representation": "object_frame"}),
            Method("absolute, paper", PAPER),
            Method("absolute, authors", {**PAPER, "prompt_format": "authors"}),
            Method("KAT", KAT),
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
    "selection": Sweep(
        "which of thirty demonstrations are shown, in the paper's noise: nearest ones fit, but are read again",
        tuple(_selected(selection, shown) for shown in (3, 10) for selection in SELECTIONS),
    ),
    "system_prompts": Sweep(
        "the paper's system prompt and its paraphrases, in the paper's format",
        tuple(Method(f"system prompt {name}", {**PAPER, "system_prompt": name}) for name in SYSTEM_PROMPTS),
    ),
    "noise": Sweep(
        "noise on object poses, in multiples of 1.68 cm and 4.61 degrees",
        (Method("no noise"), *(Method(f"noise x {scale:g}", noise=scale) for scale in NOISE)),
    ),
    "poses": Sweep(
        "poses given against poses found in images, by models learned from six labelled scenes",
        (Method("given poses"), Method("poses from images", poses="vision"), REPLAY),
    ),
    "experts": Sweep(
        "the scripted experts, and their keyframes after binning: the ceiling of every other method; asks no LLM",
        (EXPERT, REPLAY),
    ),
    "loop": Sweep(
        "one observation against one before every action",
        (Method("open loop"), Method("closed loop", source="closed loop")),
    ),
    "models": Sweep("the embedded LLMs and any given", models=EMBEDDED),
}
