"""Two predictions side by side."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from app.services.predict.evidence import configuration
from app.store.prediction_lists import ConfigurationCounts
from app.store.records import PredictionRecord
from app.store.values import JsonObject
from app.web.prediction_view import PredictionView


@dataclass(frozen=True)
class Difference:
    """A setting or cost of both; costs differ from run to run, which says nothing."""

    name: str
    one: Any
    other: Any
    is_cost: bool = False

    @property
    def differs(self) -> bool:
        return bool(not self.is_cost and self.one != self.other)


@dataclass(frozen=True)
class ActionPair:
    """The actions at one place; None where one prediction has fewer.

    Attributes:
        distance_m, turn_deg: between the two, None where one is missing.
    """

    one: JsonObject | None
    other: JsonObject | None
    distance_m: float | None = None
    turn_deg: float | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """Both, and what differs.

    Attributes:
        counts: how each one's configuration fares in its task.
        distances_m: per object that both saw, how far apart it was.
        same_prompt: whether the LLMs read the same text.
    """

    views: tuple[PredictionView, PredictionView]
    counts: tuple[ConfigurationCounts | None, ConfigurationCounts | None]
    settings: tuple[Difference, ...]
    actions: tuple[ActionPair, ...]
    distances_m: dict[str, float]
    same_prompt: bool


def compare(
    one: PredictionView,
    other: PredictionView,
    counts_one: Sequence[ConfigurationCounts],
    counts_other: Sequence[ConfigurationCounts],
) -> Comparison:
    """The two predictions; `counts_*` are the configurations of their tasks."""
    first, second = one.record, other.record
    places = {item.name: np.array(item.position_m) for item in second.objects}
    common = [item for item in first.objects if item.name in places]
    return Comparison(
        (one, other),
        (_counts_of(first, counts_one), _counts_of(second, counts_other)),
        _differences(first, second),
        tuple(_pair(a, b) for a, b in zip_longest(first.actions or (), second.actions or ())),
        {item.name: float(np.linalg.norm(np.array(item.position_m) - places[item.name])) for item in common},
        first.prompt_user == second.prompt_user,
    )


def _counts_of(record: PredictionRecord, counts: Sequence[ConfigurationCounts]) -> ConfigurationCounts | None:
    key = (record.model, record.representation, record.prompt_format, len(record.demonstration_ids))
    known = {(c.model, c.representation, c.prompt_format, c.num_demonstrations): c for c in counts}
    return known.get(key)


def _differences(one: PredictionRecord, other: PredictionRecord) -> tuple[Difference, ...]:
    return (*_differences_of(_settings(one), _settings(other)), *_differences_of(_costs(one), _costs(other), True))


def _differences_of(one: JsonObject, other: JsonObject, are_costs: bool = False) -> Iterator[Difference]:
    for name in dict.fromkeys([*one, *other]):
        yield Difference(name.replace("_", " "), one.get(name), other.get(name), are_costs)


def _settings(record: PredictionRecord) -> JsonObject:
    return {
        "task": record.task,
        "instruction": record.instruction,
        **configuration(record),
        "system prompt": record.prompt_system or "none",
        "demonstrations": [id_[:8] for id_ in record.demonstration_ids],
    }


def _costs(record: PredictionRecord) -> JsonObject:
    tokens = {f"tokens: {name.removesuffix('_tokens')}": number for name, number in record.usage.items()}
    llm_ms = record.timings_ms.get("llm")
    return {**tokens, "time of the LLM": None if llm_ms is None else f"{llm_ms:.0f} ms"}


def _pair(one: JsonObject | None, other: JsonObject | None) -> ActionPair:
    if one is None or other is None:
        return ActionPair(one, other)
    distance_m = float(np.linalg.norm(np.subtract(one["position"], other["position"])))
    turn = Rotation.from_quat(one["quaternion_xyzw"]).inv() * Rotation.from_quat(other["quaternion_xyzw"])
    return ActionPair(one, other, distance_m, float(np.degrees(turn.magnitude())))
