"""Observation and instruction -> actions, by an LLM that continues the demonstrations' pattern."""

import time
from dataclasses import asdict, dataclass

import anyio.to_thread

from app.llm.base import Completion, CompletionRequest, LanguageModelError
from app.llm.registry import ModelRegistry
from app.pipeline.episode import EndEffectorAction
from app.pipeline.errors import ReplyParseError
from app.pipeline.reply import parse_reply
from app.pipeline.workspace import DiscreteAction, discretize_action
from app.services.errors import UnparsableReplyError
from app.services.question import PredictRequest, Question, QuestionWriter
from app.services.timing import timed
from app.store import predictions
from app.store.records import PredictionDraft, PredictionStatus
from app.store.store import Store
from app.store.values import JsonObject

MAX_TOKENS_PER_ACTION = 80  # more than any representation needs for a row, a token for each digit


@dataclass(frozen=True)
class PredictedAction:
    """An action with its bins."""

    action: EndEffectorAction
    discrete: DiscreteAction

    def to_json(self) -> JsonObject:
        """As clients get it."""
        return {
            "position": self.action.position_m.tolist(),
            "quaternion_xyzw": self.action.quaternion_xyzw.tolist(),
            "gripper_open": self.action.gripper_open,
            "bins": list(self.discrete.bins),
            "clamped": self.discrete.clamped,
        }


@dataclass(frozen=True, eq=False)
class Prediction:
    """A recorded answer."""

    id: str
    question: Question
    actions: tuple[PredictedAction, ...]
    completion: Completion
    timings_ms: dict[str, float]


class PredictActions:
    """Asks an LLM for actions. The event loop waits for nothing but the LLM; the rest runs in threads."""

    def __init__(self, store: Store, models: ModelRegistry, default_model: str) -> None:
        self._store = store
        self._models = models
        self._default_model = default_model
        self._write_question = QuestionWriter(store)

    async def prepare(self, request: PredictRequest, timings_ms: dict[str, float]) -> Question:
        """The question as it would be put to the LLM, which is not called.

        Raises:
            UnknownModelError, and as QuestionWriter.
        """
        profile = self._models.get(request.model or self._default_model).profile
        return await anyio.to_thread.run_sync(self._write_question, request, profile, timings_ms)

    async def __call__(self, request: PredictRequest) -> Prediction:
        """Predict and record.

        Raises:
            as `prepare`;
            LanguageModelError: if the LLM did not answer; recorded.
            UnparsableReplyError: if its reply is not a list of valid actions; recorded, carries the reply.
        """
        started = time.perf_counter()
        timings_ms: dict[str, float] = {}
        question = await self.prepare(request, timings_ms)
        completion = await self._ask(question, timings_ms)
        try:
            with timed(timings_ms, "parse"):
                actions = _read_actions(completion, question)
        except ReplyParseError as error:
            id_ = await self._record(question, "parse_error", timings_ms, completion, error=error.message)
            raise UnparsableReplyError(error.message, completion.text, id_) from error
        with timed(timings_ms, "write"):
            id_ = await self._record(question, "ok", timings_ms, completion, actions)
        timings_ms["total"] = (time.perf_counter() - started) * 1000
        timings_ms["outside_llm"] = timings_ms["total"] - timings_ms["llm"]
        return Prediction(id_, question, actions, completion, timings_ms)

    async def _ask(self, question: Question, timings_ms: dict[str, float]) -> Completion:
        request = question.request
        completion_request = CompletionRequest(
            question.prompt,
            max_tokens=request.max_actions * MAX_TOKENS_PER_ACTION,
            timeout_s=request.timeout_s,
            seed=request.seed,
            cache_key=question.template.cache_key,
        )
        try:
            with timed(timings_ms, "llm"):
                return await self._models.get(question.profile.name).complete(completion_request)
        except LanguageModelError as error:
            await self._record(question, "model_error", timings_ms, error=str(error))
            raise

    async def _record(
        self,
        question: Question,
        status: PredictionStatus,
        timings_ms: dict[str, float],
        completion: Completion | None = None,
        actions: tuple[PredictedAction, ...] | None = None,
        error: str | None = None,
    ) -> str:
        draft = PredictionDraft(
            task=question.request.task,
            instruction=question.request.instruction,
            model=question.profile.name,
            representation=question.style.representation,
            prompt_format=question.style.prompt_format,
            status=status,
            request=question.request.as_sent,
            demonstration_ids=question.template.demonstration_ids,
            prompt_system=question.prompt.system,
            prompt_user=question.prompt.user,
            reply_text=None if completion is None else completion.text,
            actions=None if actions is None else tuple(item.to_json() for item in actions),
            error=error,
            usage={} if completion is None else asdict(completion.usage),
            timings_ms=dict(timings_ms),
        )

        def write() -> str:
            with self._store.write() as connection:
                return predictions.add(connection, draft).id

        return await anyio.to_thread.run_sync(write)


def _read_actions(completion: Completion, question: Question) -> tuple[PredictedAction, ...]:
    if completion.finish_reason == "length":
        tokens = completion.usage.completion_tokens
        raise ReplyParseError(f"the reply was cut off after {tokens} tokens", completion.text)
    codec, workspace = question.template.prompt.codec, question.settings.workspace.workspace()
    actions = parse_reply(completion.text, codec, question.objects, question.request.max_actions)
    return tuple(PredictedAction(action, discretize_action(action, workspace)) for action in actions)
