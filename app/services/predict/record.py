"""What became of a question to an LLM, kept: the prediction's row, its images, and the service's figures."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import anyio.to_thread
from sqlalchemy import Connection

from app.services.measures import Metrics, Timings, note, timed
from app.services.predict.dialogue import Dialogue
from app.services.predict.doubts import findings_of
from app.services.predict.question import PredictedAction, Question
from app.services.predict.sampled import SampledDialogue
from app.services.scene_images import put_images
from app.store import predictions
from app.store.records import PredictionDraft, PredictionStatus
from app.store.store import Store
from app.store.values import ObjectRecord


class Recorder(Protocol):
    """What keeps a prediction, or does not."""

    async def __call__(
        self,
        question: Question,
        dialogue: Dialogue | SampledDialogue,
        timings_ms: Timings,
        started_s: float,
        status: PredictionStatus,
        actions: Sequence[PredictedAction] | None = None,
        error: str | None = None,
        check: Callable[[Connection], None] = lambda _: None,
    ) -> str:
        """The prediction's id; empty where it is not kept.

        Args:
            check: called before anything is written, where anything is; what it raises goes on.
            started_s: when the request came, by `time.perf_counter`.
        """
        ...


class PredictionRecorder:
    """Records predictions, failed ones as well."""

    def __init__(self, store: Store, metrics: Metrics) -> None:
        self._store = store
        self._metrics = metrics

    async def __call__(
        self,
        question: Question,
        dialogue: Dialogue | SampledDialogue,
        timings_ms: Timings,
        started_s: float,
        status: PredictionStatus,
        actions: Sequence[PredictedAction] | None = None,
        error: str | None = None,
        check: Callable[[Connection], None] = lambda _: None,
    ) -> str:
        """Store what was asked and answered, and count it; the prediction's id.

        Args:
            check: called in the transaction before anything is written; what it raises goes on, and nothing is stored.
            timings_ms: of the stages so far; `write`, `total` and `outside_llm` are added.
            started_s: when the request came, by `time.perf_counter`.
        """
        draft = _draft(question, dialogue, timings_ms, status, actions, error)

        def write() -> str:
            cameras = put_images(self._store.blobs, question.request.cameras, question.request.images)
            with self._store.write() as connection:
                check(connection)
                return predictions.add(connection, replace(draft, cameras=cameras) if cameras else draft).id

        with timed(timings_ms, "write"):
            id_ = await anyio.to_thread.run_sync(write)
        note(prediction_id=id_)
        timings_ms["total"] = (time.perf_counter() - started_s) * 1000
        timings_ms["outside_llm"] = timings_ms["total"] - timings_ms.get("llm", 0.0)
        style, model, usage = question.style, question.profile.name, vars(dialogue.usage)
        self._metrics.observe_prediction(model, style.representation, status, timings_ms, usage)
        return id_


def _draft(
    question: Question,
    dialogue: Dialogue | SampledDialogue,
    timings_ms: Timings,
    status: PredictionStatus,
    actions: Sequence[PredictedAction] | None,
    error: str | None,
) -> PredictionDraft:
    return PredictionDraft(
        task=question.request.task,
        instruction=question.request.instruction,
        model=question.profile.name,
        representation=question.style.representation,
        prompt_format=question.style.prompt_format,
        status=status,
        request=question.request.as_sent,
        demonstration_ids=question.template.demonstration_ids,
        prompt_system=dialogue.prompt.system,
        prompt_user=dialogue.prompt.user,
        reply_text=dialogue.reply_text,
        actions=None if actions is None else tuple(item.to_json() for item in actions),
        error=error,
        usage={} if dialogue.reply_text is None else dict(vars(dialogue.usage)),
        timings_ms=dict(timings_ms),
        step=question.step,
        objects=tuple(map(ObjectRecord.of, question.observed)),
        samples=dialogue.samples,
        grounding=question.grounded.to_json(),
        findings=tuple(finding.to_json() for finding in findings_of(question, dialogue, status, error)),
    )
