"""A recorded prediction with all that its page shows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.pipeline.episode import Query, start_at
from app.pipeline.skill.skills import Off
from app.pipeline.spans import Span, prompt_spans
from app.services.predict.demonstrations import TaskReading
from app.services.predict.known import KnownReader
from app.services.predict.placed import previewed
from app.services.task_settings import TaskSettings
from app.store import episodes, predictions
from app.store.records import EpisodeRecord, PredictionRecord
from app.store.store import Store
from app.store.values import JsonObject
from app.web.play import planned_motion
from app.web.scene import frame, scene
from roboprompt_client.arms.preview import Previewed
from roboprompt_client.types.poses import EndEffectorAction, Pose

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
    """A prediction, and the demonstrations that are still stored.

    Attributes:
        off: how far each action is from where demonstrations do the same; empty where none does it in as many actions.
    """

    record: PredictionRecord
    settings: TaskSettings
    demonstrations: Mapping[str, EpisodeRecord]
    off: tuple[Off, ...]

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
    def actions(self) -> Sequence[tuple[JsonObject, Off | None, Previewed]]:
        """Each action as clients get it, how it differs from the demonstrations', and its preview on the robot.

        An arm that the settings name is assumed to move straight from its maker's ready pose to the request's end
        effector pose.
        """
        actions = self.record.actions or ()
        path = previewed(_actions(self.record), self.settings, _hand(self.record))
        return list(zip(actions, self.off or (None,) * len(actions), path, strict=True))

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


def view_prediction(store: Store, known: KnownReader, prediction_id: str) -> PredictionView:
    """The prediction of that id.

    Raises:
        NotFoundError: if there is none.
    """
    with store.read() as connection:
        record = predictions.get(connection, prediction_id)
    with known.reading(record.task, strict=False) as task:
        shown = episodes.by_ids(task.connection, record.task, record.demonstration_ids)
        return PredictionView(record, task.kept.settings, shown, _off(task, record))


def _off(task: TaskReading, record: PredictionRecord) -> tuple[Off, ...]:
    if not task.has_demonstrations:
        return ()
    observed = tuple(item.pose() for item in record.objects)
    asked = Query(str(record.grounding["instruction"]), observed, start=start_at(_hand(record)))
    skills = task.skills if asked.start is not None else task.skills.without_start
    return skills.off(asked, _actions(record))


def _actions(record: PredictionRecord) -> list[EndEffectorAction]:
    return [
        EndEffectorAction(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"])
        for item in record.actions or ()
    ]


def _hand(record: PredictionRecord) -> Pose | None:
    """Return the hand's pose that the request had."""
    hand = record.request.get("end_effector")
    return None if hand is None else Pose(hand["position"], hand["quaternion_xyzw"])
