"""Store the outcome of a question to an LLM: the prediction's row and images, and the service's metrics."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import anyio.to_thread

from app.llm.base import LanguageModelError
from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from app.pipeline.finding import Finding, finding
from app.services.errors import RefusedReply, RefusedReplyError
from app.services.images import put_images
from app.services.measures import Metrics, timed, timings
from app.services.predict.motion_check import MotionCheck
from app.services.predict.reply import Reply
from app.store import predictions, tasks
from app.store.records import PredictionDraft, PredictionStatus
from app.store.store import Store
from app.store.values import ObjectRecord
from roboprompt_client.errors import RoboPromptError, UnsafeActionError

# Per class of error the status of the stored prediction, what the finding is about, and what it says.
FAILURES: Mapping[type[RoboPromptError], tuple[PredictionStatus, str, str]] = {
    ReplyParseError: ("parse_error", "reply", "The reply is not a list of valid actions"),
    UnsafeActionError: ("unsafe_action", "actions", "An action breaks a bound of motion"),
    UnsupportedActionError: ("unsupported", "actions", "The demonstrations do not support an action"),
    LanguageModelError: ("model_error", "reply", "The LLM did not answer"),
}


@dataclass(frozen=True, eq=False)
class Prediction:
    """A recorded answer.

    Attributes:
        id: empty if it was not stored.
        findings: of the question and the reply.
    """

    id: str
    reply: Reply
    timings_ms: dict[str, float]
    findings: tuple[Finding, ...]


class PredictionRecorder:
    """Records predictions, failed ones as well."""

    def __init__(self, store: Store, metrics: Metrics) -> None:
        self._store = store
        self._metrics = metrics

    async def require_writable(self, task: str) -> None:
        """Write the task's row as it is; raises StoreUnavailableError, as on a full disk.

        The actions of a stream are carried out before the prediction is recorded.
        """

        def write() -> None:
            with self._store.write() as connection:
                tasks.rewrite(connection, task)

        await anyio.to_thread.run_sync(write)

    async def answered(self, reply: Reply, motion: MotionCheck) -> Prediction:
        """Store a reply whose actions are answered, and count it.

        Raises:
            UnsafeActionError: if limits of motion that were set since forbid an action; nothing is stored.
        """
        findings = _findings(reply)
        id_ = await self._store_reply(reply, _draft(reply, "ok", None, findings), motion)
        return Prediction(id_, reply, timings().ms, findings)

    async def failed(self, reply: Reply, error: RoboPromptError) -> None:
        """Store a question without an answer, and count it.

        Raises:
            RefusedReplyError: if the error is the reply's.
        """
        status, where, what = next(row for kind, row in FAILURES.items() if isinstance(error, kind))
        why = finding("no-actions", 0.0, f"{what}: {error}. The robot got no actions.", where)
        draft = _draft(reply, status, str(error), (*_findings(reply), why))
        id_ = await self._store_reply(reply, draft, None)
        if isinstance(error, RefusedReply):
            raise RefusedReplyError(error, reply.text or "", id_) from error

    async def _store_reply(self, reply: Reply, draft: PredictionDraft, motion: MotionCheck | None) -> str:
        request, current = reply.question.request, timings()

        def write() -> str:
            cameras = put_images(self._store.blobs, request.cameras, request.images)
            with self._store.write() as connection:
                if motion is not None:
                    motion.within(connection)
                return predictions.add(connection, replace(draft, cameras=cameras) if cameras else draft).id

        with timed("write"):
            id_ = await anyio.to_thread.run_sync(write)
        current.ms["outside_llm"] = current.reached("total") - current.ms.get("llm", 0.0)
        self._metrics.observe_prediction(draft.model, draft.representation, draft.status, current.ms, vars(reply.usage))
        return id_


def _findings(reply: Reply) -> tuple[Finding, ...]:
    return (*reply.question.findings, *reply.findings)


def _draft(reply: Reply, status: PredictionStatus, error: str | None, findings: tuple[Finding, ...]) -> PredictionDraft:
    question = reply.question
    return PredictionDraft(
        task=question.request.task,
        instruction=question.request.instruction,
        model=question.known.profile.name,
        representation=question.known.style.representation,
        prompt_format=question.known.style.prompt_format,
        status=status,
        request=question.request.as_sent,
        demonstration_ids=question.prefix.demonstration_ids,
        prompt_system=reply.prompt.system,
        prompt_user=reply.prompt.user,
        reply_text=reply.text,
        actions=None if error is not None else tuple(item.document for item in reply.actions),
        error=error,
        usage={} if reply.text is None else dict(vars(reply.usage)),
        timings_ms=dict(timings().ms),
        objects=tuple(map(ObjectRecord.of, question.known.observed)),
        grounding=question.grounded.to_json(),
        findings=tuple(finding.to_json() for finding in findings),
    )
