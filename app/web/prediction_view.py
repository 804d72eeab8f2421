"""A recorded prediction with all that its page shows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

from app.pipeline.comparison import ActionDeviation
from app.pipeline.prompt_colours import Span, prompt_spans
from app.services.predict.evidence import Explanation, explain_prediction
from app.services.predict.select import demonstrations_of
from app.services.task_settings import TaskSettings
from app.store import episodes, predictions, tasks
from app.store.prediction_lists import Fate
from app.store.records import DemonstrationRecord, EpisodeRecord, PredictionRecord
from app.store.values import JsonObject
from app.web.scene import frame, scene

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
    def fate(self) -> Fate:
        """As lists tell it."""
        if self.record.outcome_success is not None:
            return "success" if self.record.outcome_success else "failure"
        return "unknown" if self.record.status == "ok" else "refused"

    @property
    def prompt(self) -> tuple[Span, ...]:
        """What the LLM read, in the paper's colours."""
        return self._spans(self.record.prompt_user)

    @property
    def reply(self) -> tuple[Span, ...]:
        """What it replied."""
        return self._spans(self.record.reply_text or "")

    def _spans(self, text: str) -> tuple[Span, ...]:
        return prompt_spans(text, self.record.representation, self.record.prompt_format)

    @property
    def actions(self) -> Sequence[tuple[JsonObject, ActionDeviation | None]]:
        """Each action as clients get it, and how it differs from the demonstrations'."""
        actions, deviations = self.record.actions or (), self.explanation.deviations
        return list(zip(actions, deviations or (None,) * len(actions), strict=True))

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
        return scene(self.settings.workspace, self.record.objects, frames, shown=shown)


def view_prediction(connection: Connection, prediction_id: str) -> PredictionView:
    """The prediction of that id.

    Raises:
        NotFoundError: if there is none.
    """
    record = predictions.get(connection, prediction_id)
    settings = TaskSettings.model_validate(tasks.get(connection, record.task).settings)
    shown = episodes.by_ids(connection, record.task, record.demonstration_ids)
    records = [
        DemonstrationRecord(e.id, e.instruction, e.objects, e.keyframes, e.control_frequency_hz) for e in shown.values()
    ]
    ids = [item.id for item in records]
    demonstrations = demonstrations_of(
        records, lambda: episodes.get_trajectories(connection, ids), settings, all_of_them=True
    )
    return PredictionView(record, settings, shown, explain_prediction(record, demonstrations))
