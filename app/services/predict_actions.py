"""Observation and instruction -> actions, by an LLM that continues the demonstrations' pattern."""

import time
from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import asdict, dataclass, replace

import anyio.to_thread

from app.llm.base import Completion, LanguageModelError, TextDelta
from app.llm.registry import ModelRegistry
from app.pipeline.episode import EndEffectorAction
from app.pipeline.errors import ReplyParseError, UnsafeActionError
from app.pipeline.motion_limits import MotionGuard
from app.pipeline.prompt import Prompt
from app.pipeline.workspace import DiscreteAction, discretize_actions
from app.services.dialogue import Dialogue
from app.services.errors import UnparsableReplyError, UnsafeReplyError
from app.services.log_fields import note
from app.services.metrics import Metrics
from app.services.prefix_warmer import PrefixWarmer
from app.services.question import PredictRequest, Question
from app.services.sampled_dialogue import SampledDialogue
from app.services.stored_images import put_images
from app.services.timing import timed
from app.services.watch_predictions import watched
from app.services.write_question import QuestionWriter
from app.store import predictions
from app.store.records import PredictionDraft, PredictionStatus
from app.store.store import Store
from app.store.values import JsonObject, ObjectRecord


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
    """A recorded answer.

    Attributes:
        prompt: the last that the LLM was asked: with several instructions it holds the replies to those before.
        samples: where several replies were asked for, each of them.
    """

    id: str
    question: Question
    prompt: Prompt
    actions: tuple[PredictedAction, ...]
    completion: Completion
    timings_ms: dict[str, float]
    samples: tuple[JsonObject, ...] | None = None


class PredictActions:
    """Asks an LLM for actions. The event loop waits for nothing but the LLM; the rest runs in threads."""

    def __init__(
        self,
        store: Store,
        models: ModelRegistry,
        write_question: QuestionWriter,
        warmer: PrefixWarmer,
        metrics: Metrics,
    ) -> None:
        self._store = store
        self._models = models
        self._write_question = write_question
        self._warmer = warmer
        self._metrics = metrics

    async def prepare(self, request: PredictRequest, timings_ms: dict[str, float]) -> Question:
        """The question as it would be put to the LLM, which is not called.

        Raises:
            as QuestionWriter.
        """
        note(task=request.task)
        return await anyio.to_thread.run_sync(self._write_question, request, timings_ms)

    async def __call__(self, request: PredictRequest) -> Prediction:
        """Predict and record.

        Raises:
            as `prepare` and `stream`.
        """
        timings_ms: dict[str, float] = {}
        started = time.perf_counter()
        question = await self.prepare(request, timings_ms)
        async with aclosing(self.answer(question, timings_ms, started, piecewise=False)) as answer:
            async for item in answer:
                if isinstance(item, Prediction):
                    return item
        raise AssertionError("an answer ends with a prediction")

    async def answer(
        self, question: Question, timings_ms: dict[str, float], started_s: float, *, piecewise: bool
    ) -> AsyncGenerator[PredictedAction | TextDelta | Prediction, None]:
        """The actions (and, if wished, pieces of text) as they become complete, then the whole prediction, recorded.

        Args:
            started_s: when the request came, by `time.perf_counter`.
            piecewise: read the reply while it arrives; otherwise every action comes at its end.

        Raises:
            LanguageModelError: if the LLM did not answer; recorded.
            UnparsableReplyError: if its reply is not a list of valid actions; recorded, carries the reply.
            UnsafeReplyError: if an action is beyond a bound of motion; recorded, carries the reply.
        """
        kind = SampledDialogue if question.samples else Dialogue
        dialogue = kind(question, self._models.get(question.profile.name), timings_ms)
        actions: list[PredictedAction] = []
        workspace = question.settings.workspace.workspace()
        limits = question.settings.limits_of_motion()
        guard = MotionGuard(limits, question.request.max_actions, question.end_effector)
        try:
            with self._warmer.giving_way():
                async with (
                    watched(self._store.under_way, question),
                    aclosing(dialogue.actions(piecewise=piecewise)) as arriving,
                ):
                    async for arrived in arriving:
                        if isinstance(arrived, TextDelta):
                            yield arrived
                            continue
                        for action in arrived:
                            guard.check(action)
                        timings_ms.setdefault("first_action", (time.perf_counter() - started_s) * 1000)
                        new = list(map(PredictedAction, arrived, discretize_actions(arrived, workspace)))
                        actions += new
                        for item in new:
                            yield item
        except ReplyParseError as error:
            id_ = await self._record(question, "parse_error", timings_ms, dialogue, error=error.message)
            self._observe(question, "parse_error", timings_ms, dialogue)
            raise UnparsableReplyError(error.message, dialogue.reply_text or "", id_) from error
        except UnsafeActionError as error:
            id_ = await self._record(question, "unsafe_action", timings_ms, dialogue, error=str(error))
            self._observe(question, "unsafe_action", timings_ms, dialogue)
            raise UnsafeReplyError(error, dialogue.reply_text or "", id_) from error
        except LanguageModelError as error:
            await self._record(question, "model_error", timings_ms, dialogue, error=str(error))
            self._observe(question, "model_error", timings_ms, dialogue)
            raise
        with timed(timings_ms, "write"):
            id_ = await self._record(question, "ok", timings_ms, dialogue, tuple(actions))
        timings_ms["total"] = (time.perf_counter() - started_s) * 1000
        timings_ms["outside_llm"] = timings_ms["total"] - timings_ms["llm"]
        self._observe(question, "ok", timings_ms, dialogue)
        completion = Completion(dialogue.reply_text or "", dialogue.usage)
        yield Prediction(id_, question, dialogue.prompt, tuple(actions), completion, timings_ms, dialogue.samples)

    async def _record(
        self,
        question: Question,
        status: PredictionStatus,
        timings_ms: dict[str, float],
        dialogue: Dialogue | SampledDialogue,
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
            prompt_system=dialogue.prompt.system,
            prompt_user=dialogue.prompt.user,
            reply_text=dialogue.reply_text,
            actions=None if actions is None else tuple(item.to_json() for item in actions),
            error=error,
            usage={} if dialogue.reply_text is None else asdict(dialogue.usage),
            timings_ms=dict(timings_ms),
            step=question.step,
            objects=tuple(map(ObjectRecord.of, question.observed)),
            samples=dialogue.samples,
        )

        def write() -> str:
            cameras = put_images(self._store.blobs, question.request.frames, question.request.images)
            with self._store.write() as connection:
                return predictions.add(connection, replace(draft, cameras=cameras) if cameras else draft).id

        id_ = await anyio.to_thread.run_sync(write)
        note(prediction_id=id_)
        return id_

    def _observe(
        self,
        question: Question,
        status: PredictionStatus,
        timings_ms: dict[str, float],
        dialogue: Dialogue | SampledDialogue,
    ) -> None:
        style, model = question.style, question.profile.name
        self._metrics.observe_prediction(model, style.representation, status, timings_ms, asdict(dialogue.usage))
