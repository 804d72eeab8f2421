"""A recorded prediction with all that its page shows, several side by side, and success over time."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, zip_longest
from math import degrees, dist
from typing import Any

from sqlalchemy import Connection

from app.pipeline.deviation import ActionDeviation
from app.pipeline.spans import Span, prompt_spans
from app.pipeline.success_rate import SuccessRate
from app.services.predict.evidence import Explanation, configuration, explanation, path_of
from app.services.predict.known import KnownReader
from app.services.task_settings import TaskSettings
from app.store import episodes, prediction_lists, predictions
from app.store.prediction_lists import Configuration, Counts
from app.store.records import EpisodeRecord, PredictionRecord
from app.store.values import JsonObject
from app.web.page import usd
from app.web.play import planned_motion
from app.web.scene import frame, scene
from roboprompt_client.arms.preview import Previewed
from roboprompt_client.types.quaternions import angle_between_rad

MAX_STRETCHES = 10
LEAST = 3  # predictions in a stretch: of fewer the interval is nearly everything
WIDTH, HEIGHT = 100.0, 28.0  # units of the drawing
STAGES = {
    "read": "Reading the demonstrations",
    "poses": "Finding the objects",
    "prompt": "Writing the prompt",
    "words": "Understanding the instruction",
    "llm": "The LLM",
    "first_action": "Until the first action",
    "parse": "Reading the reply",
    "write": "Recording",
    "outside_llm": "All but the LLM",
    "total": "Altogether",
}


@dataclass(frozen=True, eq=False)
class PredictionView:
    """A prediction, the demonstrations that are still stored, and how it lies among them."""

    record: PredictionRecord
    settings: TaskSettings
    demonstrations: Mapping[str, EpisodeRecord]
    explanation: Explanation

    @property
    def prompt(self) -> tuple[Span, ...]:
        """What the LLM read, in the paper's colors."""
        return self._spans(self.record.prompt_user)

    @property
    def reply(self) -> tuple[Span, ...]:
        """What it replied."""
        return self._spans(self.record.reply_text or "")

    @property
    def num_written(self) -> int:
        """How many of its demonstrations the prompt spells out: those that read alike are written once.

        Each has its instruction in the text, and so has the query.
        """
        instructions = sum(span.kind == "instruction" for span in self.prompt)
        known = 1 < instructions <= len(self.record.demonstration_ids)
        return instructions - 1 if known else len(self.record.demonstration_ids)

    def _spans(self, text: str) -> tuple[Span, ...]:
        return prompt_spans(text, self.record.representation, self.record.prompt_format)

    @cached_property
    def actions(self) -> Sequence[tuple[JsonObject, ActionDeviation | None, Previewed]]:
        """Each action as clients get it, how it differs from the demonstrations', and its preview on the robot."""
        actions, deviations = self.record.actions or (), self.explanation.deviations
        path = path_of(self.record, self.settings)
        return list(zip(actions, deviations or (None,) * len(actions), path, strict=True))

    @property
    def stages(self) -> Sequence[tuple[str, float]]:
        """What took how many milliseconds."""
        return [(text, self.record.timings_ms[name]) for name, text in STAGES.items() if name in self.record.timings_ms]

    @property
    def scene(self) -> JsonObject:
        """For the 3D view."""
        actions = enumerate(self.record.actions or (), start=1)
        frames = [
            frame(str(k), item["position"], item["quaternion_xyzw"], gripper_open=item["gripper_open"])
            for k, item in actions
        ]
        shown = [item for record in self.demonstrations.values() for item in record.objects]
        drawn = scene(self.settings.workspace, self.record.objects, frames, shown=shown)
        ways = [[item.position_m for item in record.keyframes] for record in self.demonstrations.values()]
        return {**drawn, "ways": ways, "play": planned_motion(self.record, self.settings)}


def view_prediction(connection: Connection, known: KnownReader, prediction_id: str) -> PredictionView:
    """The prediction of that id.

    Raises:
        NotFoundError: if there is none.
    """
    record = predictions.get(connection, prediction_id)
    settings = TaskSettings.of(connection, record.task)
    shown = episodes.by_ids(connection, record.task, record.demonstration_ids)
    return PredictionView(record, settings, shown, explanation(connection, known, record, tuple(shown)))


@dataclass(frozen=True)
class Difference:
    """A setting or cost of each; costs differ from run to run, which says nothing."""

    name: str
    values: Sequence[Any]
    is_cost: bool = False

    @property
    def differs(self) -> bool:
        return not self.is_cost and any(value != self.values[0] for value in self.values)


@dataclass(frozen=True)
class Placed:
    """A pose of one prediction, and how far it is from the first one's, where both have it."""

    pose: JsonObject
    away_m: float | None = None
    turn_deg: float | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """Several predictions, and what differs; the first is what the others are compared with.

    Attributes:
        counts: the success of each one's configuration in its task.
        actions: for each place in the plan, what each prediction has there; None where it has fewer.
        objects: by name, where each prediction saw it; None where it did not.
    """

    views: Sequence[PredictionView]
    counts: Sequence[Counts | None]
    settings: Sequence[Difference]
    actions: Sequence[Sequence[Placed | None]]
    objects: Mapping[str, Sequence[Placed | None]]


def compare(connection: Connection, views: Sequence[PredictionView]) -> Comparison:
    """The predictions, side by side."""
    records = [view.record for view in views]
    seen = [{item.name: {"position": item.position_m} for item in record.objects} for record in records]
    names = dict.fromkeys(name for objects in seen for name in objects)
    return Comparison(
        views,
        [_counts_of(connection, record) for record in records],
        [*_differences(list(map(_settings, records))), *_differences(list(map(_costs, records)), are_costs=True)],
        [_beside(poses) for poses in zip_longest(*(record.actions or () for record in records))],
        {name: _beside([objects.get(name) for objects in seen]) for name in names},
    )


def _counts_of(connection: Connection, record: PredictionRecord) -> Counts | None:
    return prediction_lists.counts_by_configuration(connection, record.task).get(Configuration.of(record))


def _differences(documents: Sequence[JsonObject], are_costs: bool = False) -> Iterator[Difference]:
    for name in dict.fromkeys(name for document in documents for name in document):
        text = name.replace("num_", "number of ").replace("_", " ")
        yield Difference(text, [document.get(name) for document in documents], are_costs)


def _settings(record: PredictionRecord) -> JsonObject:
    return {
        "task": record.task,
        "instruction": record.instruction,
        **configuration(record),
        "system prompt": record.prompt_system or "none",
        "demonstrations": [id_[:8] for id_ in record.demonstration_ids],
    }


def _costs(record: PredictionRecord) -> JsonObject:
    tokens = {f"tokens: {name.removesuffix('_tokens')}": number for name, number in record.tokens.items()}
    llm_ms = record.timings_ms.get("llm")
    costs = {} if record.cost_usd is None else {"cost": usd(record.cost_usd)}
    return {**tokens, **costs, "time of the LLM": None if llm_ms is None else f"{llm_ms:.0f} ms"}


def _beside(poses: Sequence[JsonObject | None]) -> Sequence[Placed | None]:
    first = poses[0]
    return [None if pose is None else Placed(pose) if pose is first else _from(first, pose) for pose in poses]


def _from(first: JsonObject | None, other: JsonObject) -> Placed:
    if first is None:
        return Placed(other)
    turns = [pose["quaternion_xyzw"] for pose in (first, other) if "quaternion_xyzw" in pose]
    turn_deg = degrees(angle_between_rad(*turns)) if turns else None
    return Placed(other, dist(first["position"], other["position"]), turn_deg)


@dataclass(frozen=True)
class OverTime:
    """What the template draws.

    Attributes:
        line: the rate of each stretch, as SVG writes points.
        band: around their 95 % intervals, as SVG writes points.
        words: the same for people who do not see it.
    """

    line: str
    band: str
    words: str


def over_time(successes: Sequence[bool]) -> OverTime | None:
    """Success in stretches of equally many predictions, oldest first; None where they are too few for two stretches."""
    number = min(MAX_STRETCHES, len(successes) // LEAST)
    if number < 2:
        return None
    ends = [round(k * len(successes) / number) for k in range(number + 1)]
    rates = [SuccessRate(sum(successes[a:b]), b - a) for a, b in pairwise(ends)]
    line = [_point(k, number, rate.successes / rate.trials) for k, rate in enumerate(rates)]
    low = [_point(k, number, rate.interval[0]) for k, rate in enumerate(rates)]
    high = [_point(k, number, rate.interval[1]) for k, rate in enumerate(rates)]
    words = ", ".join(f"{rate.successes} of {rate.trials}" for rate in rates)
    return OverTime(" ".join(line), " ".join([*low, *reversed(high)]), f"in turn {words}")


def _point(index: int, number: int, share: float) -> str:
    return f"{WIDTH * index / (number - 1):.1f},{HEIGHT * (1 - share):.1f}"
