"""What became of a question to an LLM, kept: the prediction's row, its images, and the service's figures."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import anyio.to_thread
from sqlalchemy import Connection

from app.pipeline.findings import Finding
from app.services.measures import Metrics, Timings, note, timed
from app.services.predict.dialogue import Dialogue
from app.services.predict.doubts import findings_of
from app.services.predict.program_dialogue import ProgramDialogue
from app.services.predict.question import PredictedAction, Question
from app.services.predict.sampled import SampledDialogue
from app.services.scene_images import put_images
from app.store import predictions
from app.store.records import PredictionDraft, PredictionStatus
from app.store.store import Store
from app.store.values import ObjectRecord

AnyDialogue = Dialogue | SampledDialogue | ProgramDialogue
Check = Callable[[Connection], None]


def _nothing_to_check(_: Connection) -> None:
    pass


@dataclass(frozen=True, eq=False)
class Ended:
    """What became of a question.

    Attributes:
        timings_ms: of the stages so far; whoever keeps the prediction adds `write`, `total` and `outside_llm`.
        started_s: when the request came, by `time.perf_counter`.
        actions: None if the reply had none; `error` None if all went well.
    """

    question: Question
    dialogue: AnyDialogue
    timings_ms: Timings
    started_s: float
    status: PredictionStatus
    actions: Sequence[PredictedAction] | None = None
    error: str | None = None

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """All that deserves a look."""
        return findings_of(self.question, self.dialogue, self.status, self.error)


class Recorder(Protocol):
    """What keeps a prediction, or does not."""

    async def __call__(self, ended: Ended, check: Check = _nothing_to_check) -> str:
        """The prediction's id; empty where it is not kept.

        Args:
            check: called in the transaction before anything is written; what it raises goes on, and nothing is stored.
        """
        ...


class PredictionRecorder:
    """Records predictions, failed ones as well."""

    def __init__(self, store: Store, metrics: Metrics) -> None:
        self._store = store
        self._metrics = metrics

    async def __call__(self, ended: Ended, check: Check = _nothing_to_check) -> str:
        """Store what was asked and answered, and count it; see `Recorder`."""
        question, timings_ms, draft = ended.question, ended.timings_ms, _draft(ended)

        def write() -> str:
            cameras = put_images(self._store.blobs, question.request.cameras, question.request.images)
            with self._store.write() as connection:
                check(connection)
                return predictions.add(connection, replace(draft, cameras=cameras) if cameras else draft).id

        with timed(timings_ms, "write"):
            id_ = await anyio.to_thread.run_sync(write)
        note(prediction_id=id_)
        timings_ms["total"] = (time.perf_counter() - ended.started_s) * 1000
        timings_ms["outside_llm"] = timings_ms["total"] - timings_ms.get("llm", 0.0)
        style, model, usage = question.style, question.profile.name, vars(ended.dialogue.usage)
        self._metrics.observe_prediction(model, style.representation, ended.status, timings_ms, usage)
        return id_


async def leave_unrecorded(ended: Ended, check: Check = _nothing_to_check) -> str:
    """In place of a `PredictionRecorder`: what a check asks is no robot's prediction, and no statistic counts it."""
    return ""


def _draft(ended: Ended) -> PredictionDraft:
    question, dialogue, actions = ended.question, ended.dialogue, ended.actions
    return PredictionDraft(
        task=question.request.task,
        instruction=question.request.instruction,
        model=question.profile.name,
        representation=question.style.representation,
        prompt_format=question.style.prompt_format,
        status=ended.status,
        request=question.request.as_sent,
        demonstration_ids=question.template.demonstration_ids,
        prompt_system=dialogue.prompt.system,
        prompt_user=dialogue.prompt.user,
        reply_text=dialogue.reply_text,
        actions=None if actions is None else tuple(item.to_json() for item in actions),
        error=ended.error,
        usage={} if dialogue.reply_text is None else dict(vars(dialogue.usage)),
        timings_ms=dict(ended.timings_ms),
        step=question.step,
        objects=tuple(map(ObjectRecord.of, question.observed)),
        samples=dialogue.samples,
        grounding=question.grounded.to_json(),
        findings=tuple(finding.to_json() for finding in ended.findings),
    )
