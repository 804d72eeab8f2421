"""What in a recorded prediction deserves a look: facts that a person who asks why it failed would look up first."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.pipeline.comparison import ActionDeviation, ObjectReach, action_deviations, object_reach
from app.pipeline.episode import Demonstration, EndEffectorAction
from app.pipeline.language import clauses
from app.pipeline.workspace import ROTATION_BIN_DEG
from app.services.demonstrations import Demonstrations
from app.services.task_settings import TaskSettings
from app.store.records import PredictionRecord

# What the bins alone may do: half a bin where the demonstration was written and half where the reply is read.
TOLERATED_TURN_DEG = ROTATION_BIN_DEG
_STATUS = {
    "parse_error": "The reply is not a list of valid actions",
    "unsafe_action": "An action breaks a bound of motion",
    "unsupported": "The demonstrations do not support an action",
    "model_error": "The LLM did not answer",
}


@dataclass(frozen=True)
class Finding:
    """Something that deserves a look.

    Attributes:
        where: the part of the prediction: reply, note, instruction, objects, actions or demonstrations.
    """

    where: str
    title: str
    text: str


@dataclass(frozen=True)
class Explanation:
    """A prediction held against its demonstrations.

    Attributes:
        findings: the likeliest to explain a failure first; empty if everything is as the demonstrations have it.
        reaches: by object name; empty without demonstrations.
        deviations: of each action; empty where no demonstration does the same in as many actions.
        missing_ids: demonstrations that were deleted since.
    """

    findings: tuple[Finding, ...]
    reaches: dict[str, ObjectReach]
    deviations: tuple[ActionDeviation, ...]
    missing_ids: tuple[str, ...]


def explain_prediction(record: PredictionRecord, demonstrations: Demonstrations, settings: TaskSettings) -> Explanation:
    """Hold a prediction against those of its demonstrations that are still stored."""
    shown = demonstrations.recorded
    observed = tuple(item.pose() for item in record.objects)
    predicted = Demonstration(_canonical(record), observed, tuple(_actions(record)))
    reaches = {pose.name: object_reach(pose, shown) for pose in observed} if shown else {}
    # A step of a closed loop is one action out of several; its demonstrations are not told apart by step here.
    deviations = action_deviations(predicted, shown) if record.step is None else ()
    stored = {item.id for item in shown}
    missing = tuple(id_ for id_ in record.demonstration_ids if id_ not in stored)
    bin_m = float(settings.workspace.workspace().bin_size_m.max())
    findings = (
        *_reply(record),
        *(finding for name in reaches for finding in _reach(reaches[name], bin_m)),
        *_poses(record),
        *_instruction(record, shown),
        *(_number(predicted, shown) if record.step is None else ()),
        *(finding for k, item in enumerate(deviations) for finding in _deviation(k, item, bin_m)),
        *_missing(missing, record),
    )
    return Explanation(findings, reaches, deviations, missing)


def _canonical(record: PredictionRecord) -> str:
    """The instruction as the LLM read it."""
    return record.instruction if record.grounding is None else str(record.grounding["instruction"])


def _actions(record: PredictionRecord) -> Iterator[EndEffectorAction]:
    for item in record.actions or ():
        yield EndEffectorAction(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"])


def _reply(record: PredictionRecord) -> Iterator[Finding]:
    if record.status != "ok":
        yield Finding("reply", _STATUS[record.status], f"{record.error}. The robot got no actions.")


def _reach(reach: ObjectReach, bin_m: float) -> Iterator[Finding]:
    """Beyond the demonstrations the LLM must go on with a pattern instead of filling it in."""
    axis = int(np.argmax(np.abs(reach.beyond_m)))
    beyond_m = reach.beyond_m[axis]
    if abs(beyond_m) <= bin_m:
        return
    name = "xyz"[axis]
    text = (
        f"{100 * abs(beyond_m):.1f} cm beyond the demonstrations along {name}: they have it from"
        f" {reach.low_m[axis]:.3f} to {reach.high_m[axis]:.3f} m. Demonstrations nearer to it may help."
    )
    yield Finding("objects", f"{reach.name} lies outside of what was shown", text)


def _poses(record: PredictionRecord) -> Iterator[Finding]:
    for item in record.objects:
        if item.reason or item.confidence < 1:
            text = f"{item.estimator}, confidence {item.confidence:.2f}" + (f": {item.reason}" if item.reason else "")
            yield Finding("objects", f"The pose of {item.name} is not certain", f"{text}.")


def _instruction(record: PredictionRecord, shown: Sequence[Demonstration]) -> Iterator[Finding]:
    told = list(dict.fromkeys(item.instruction for item in shown))
    if told and _canonical(record) not in told:
        listed = ", ".join(f"“{text}”" for text in told[:3]) + (f" and {len(told) - 3} more" if told[3:] else "")
        yield Finding("instruction", "No demonstration has this instruction", f"They have {listed}.")


def _number(predicted: Demonstration, shown: Sequence[Demonstration]) -> Iterator[Finding]:
    counts = sorted({len(item.actions) for item in shown})
    if not predicted.actions or not counts or len(clauses(predicted.instruction)) > 1:
        return
    if not counts[0] <= len(predicted.actions) <= counts[-1]:
        between = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
        yield Finding("actions", f"{len(predicted.actions)} actions", f"The demonstrations have {between}.")


def _deviation(k: int, item: ActionDeviation, bin_m: float) -> Iterator[Finding]:
    if not item.gripper_shown:
        yield Finding("actions", f"Action {k + 1} has the gripper the other way", "No demonstration has it so there.")
    if item.offset_m > item.spread_m + bin_m:
        text = (
            f"{100 * item.offset_m:.1f} cm from where the demonstrations go, seen from {item.object_name};"
            f" they themselves differ by up to {100 * item.spread_m:.1f} cm."
        )
        yield Finding("actions", f"Action {k + 1} goes elsewhere", text)
    if item.turn_deg > item.turn_spread_deg + TOLERATED_TURN_DEG:
        text = (
            f"{item.turn_deg:.0f}° from the demonstrations' mean, seen from {item.object_name};"
            f" they themselves differ by up to {item.turn_spread_deg:.0f}°."
        )
        yield Finding("actions", f"Action {k + 1} is turned otherwise", text)


def _missing(missing: Sequence[str], record: PredictionRecord) -> Iterator[Finding]:
    if missing:
        text = f"{len(missing)} of the {len(record.demonstration_ids)} that it was shown."
        yield Finding("demonstrations", "Demonstrations were deleted since", text)


def configuration(record: PredictionRecord) -> dict[str, Any]:
    """The settings that a prediction was made with, as a request names them."""
    asked = ("selection", "seed", "max_actions", "closed_loop", "num_samples", "temperature", "permute_demonstrations")
    return {
        "model": record.model,
        "representation": record.representation,
        "prompt_format": record.prompt_format,
        "num_demonstrations": len(record.demonstration_ids),
        **{name: record.request[name] for name in asked if name in record.request},
    }
