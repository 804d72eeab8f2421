"""Observation and instruction -> actions, by an LLM that continues the demonstrations' pattern.

While a prediction takes long, people see it from whichever process they look.
"""

import asyncio
import logging
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import aclosing, asynccontextmanager
from dataclasses import replace
from functools import partial
from uuid import uuid4

import anyio.to_thread

from app.llm.base import Completion, LanguageModel, LanguageModelError, TextDelta
from app.llm.registry import ModelRegistry
from app.pipeline.errors import InstructionError, ReplyParseError, UnsupportedActionError
from app.pipeline.workspace import discretize_actions
from app.services.limits import UnparsableReplyError, UnsafeReplyError, UnsupportedReplyError
from app.services.measures import Timings, note, timed
from app.services.motion_bounds import ActionCheck, CurrentLimits
from app.services.predict.dialogue import Dialogue
from app.services.predict.instruction import ask_meaning
from app.services.predict.program_dialogue import ProgramDialogue
from app.services.predict.question import PredictedAction, Prediction, PredictRequest, ProgramQuestion, Question
from app.services.predict.record import AnyDialogue, Ended, Recorder
from app.services.predict.sampled import SampledDialogue
from app.services.predict.warm import PrefixWarmer
from app.services.predict.write import QuestionWriter
from app.store.errors import StoreUnavailableError
from app.store.processes import UnderWay, UnderWayNotes
from app.store.records import PredictionStatus
from roboprompt_client.errors import RoboPromptError, UnsafeActionError

SHOWN_AFTER_S = 0.5  # shorter ones are never written down
GRACE_S = 5.0  # a note that a killed process leaves behind outlives its request's deadline by no more
logger = logging.getLogger(__name__)
_showing: set[asyncio.Task[None]] = set()  # the event loop itself holds its tasks weakly


@asynccontextmanager
async def watched(notes: UnderWayNotes, question: Question) -> AsyncIterator[None]:
    """Let the prediction be seen while the body runs, if it runs for long. The body waits for nothing of this."""
    request, now_s = question.request, time.time()
    deadline_s = now_s + request.options.timeout_s + GRACE_S
    note = UnderWay(uuid4().hex, request.task, request.instruction, question.profile.name, now_s, deadline_s)
    ended = asyncio.Event()

    def show() -> None:
        showing = asyncio.create_task(_show(notes, note, ended))
        _showing.add(showing)
        showing.add_done_callback(_showing.discard)

    timer = asyncio.get_running_loop().call_later(SHOWN_AFTER_S, show)
    try:
        yield
    finally:
        timer.cancel()
        ended.set()


async def _show(notes: UnderWayNotes, note: UnderWay, ended: asyncio.Event) -> None:
    try:
        await anyio.to_thread.run_sync(notes.begin, note)
    except StoreUnavailableError as error:
        logger.warning("%s", error)  # nobody sees it, but it goes on
    await ended.wait()
    await anyio.to_thread.run_sync(notes.end, note.id)


FAILURES = (ReplyParseError, UnsafeActionError, UnsupportedActionError, LanguageModelError)


class PredictActions:
    """Asks an LLM for actions. The event loop waits for nothing but the LLM; the rest runs in threads."""

    def __init__(
        self,
        models: ModelRegistry,
        write_question: QuestionWriter,
        warmer: PrefixWarmer,
        record: Recorder,
        under_way: UnderWayNotes,
        limits: CurrentLimits,
    ) -> None:
        self._models = models
        self._write_question = write_question
        self._warmer = warmer
        self._record = record
        self._under_way = under_way
        self._limits = limits

    async def prepare(
        self, request: PredictRequest, timings_ms: dict[str, float], *, ask_meaning: bool = True
    ) -> Question:
        """The question as it would be put to the LLM.

        Args:
            ask_meaning: where the words of the instruction are not clear, ask a chat model which of the instructions
                that the task knows they mean; otherwise no LLM is called.

        Raises:
            as QuestionWriter.
        """
        note(task=request.task)
        try:
            question = await anyio.to_thread.run_sync(self._write_question, request, timings_ms)
        except InstructionError as error:
            meaning = await self._meaning(request, error, timings_ms) if ask_meaning else None
            if meaning is None:
                raise
            question = await anyio.to_thread.run_sync(
                self._write_question, replace(request, meaning=meaning), timings_ms
            )
        return question.without_frames()

    async def _meaning(self, request: PredictRequest, error: InstructionError, timings_ms: Timings) -> str | None:
        """The instruction that an unclear one stands for, if the request's model finds it."""
        if not error.choices:
            return None
        with timed(timings_ms, "words"):
            async with self._models.using(self._write_question.model_of(request)) as model:
                return await ask_meaning(model, request.instruction, error.choices, request.options.timeout_s)

    async def __call__(self, request: PredictRequest) -> Prediction:
        """Predict and record.

        Raises:
            as `prepare` and `stream`.
        """
        timings_ms: dict[str, float] = {}
        started_s = time.perf_counter()
        return await self.complete(await self.prepare(request, timings_ms), timings_ms, started_s)

    async def complete(self, question: Question, timings_ms: dict[str, float], started_s: float) -> Prediction:
        """The whole prediction, recorded.

        Args, raises:
            as `answer`.
        """
        async with aclosing(self.answer(question, timings_ms, started_s, piecewise=False)) as answer:
            async for item in answer:
                if isinstance(item, Prediction):
                    return item
        raise AssertionError("an answer ends with a prediction")

    async def answer(
        self, question: Question, timings_ms: dict[str, float], started_s: float, *, piecewise: bool
    ) -> AsyncGenerator[PredictedAction | TextDelta | Prediction, None]:
        """The actions (and, if asked for, pieces of text) as they become complete, then the whole prediction, recorded.

        Args:
            started_s: when the request came, by `time.perf_counter`.
            piecewise: read the reply while it arrives; otherwise every action comes at its end.

        Raises:
            LanguageModelError: if the LLM did not answer; recorded.
            UnparsableReplyError: if its reply is not a list of valid actions; recorded, carries the reply.
            UnsupportedReplyError: if the demonstrations do not support an action; recorded, carries the reply.
            UnsafeReplyError: if an action is beyond a bound of motion of the moment; recorded, carries the reply.
        """
        async with self._models.using(question.profile.name) as model:
            dialogue = _dialogue(question, model, timings_ms)
            ended = partial(Ended, question, dialogue, timings_ms, started_s)
            actions: list[PredictedAction] = []
            check = ActionCheck(self._limits, question)
            try:
                async with aclosing(self._checked(question, dialogue, check, piecewise=piecewise)) as arriving:
                    async for item in arriving:
                        if isinstance(item, PredictedAction):
                            timings_ms.setdefault("first_action", (time.perf_counter() - started_s) * 1000)
                            actions.append(item)
                        yield item
            except FAILURES as error:
                await self._record_failure(error, ended)
                raise
        answered = ended("ok", actions)
        try:
            id_ = await self._record(answered, check.within)
        except UnsafeActionError as error:  # beyond limits that were set after the last action came
            await self._record_failure(error, ended)
            raise
        completion = Completion(dialogue.reply_text or "", dialogue.usage)
        yield Prediction(
            id_, question, dialogue.prompt, tuple(actions), completion, timings_ms, dialogue.samples, answered.findings
        )

    async def _checked(
        self,
        question: Question,
        dialogue: AnyDialogue,
        check: ActionCheck,
        *,
        piecewise: bool,
    ) -> AsyncGenerator[PredictedAction | TextDelta, None]:
        """The dialogue's actions, each within the bounds of motion; meanwhile people see that it is under way."""
        workspace = question.settings.workspace.workspace()
        done = 0
        with self._warmer.giving_way():
            async with (
                watched(self._under_way, question),
                aclosing(dialogue.actions(piecewise=piecewise)) as arriving,
            ):
                async for arrived in arriving:
                    if isinstance(arrived, TextDelta):
                        yield arrived
                        continue
                    await check.arrived(arrived)
                    rows = dialogue.rows[done : done + len(arrived)] or [None] * len(arrived)
                    done += len(arrived)
                    for k, item in enumerate(
                        map(PredictedAction, arrived, discretize_actions(arrived, workspace), rows)
                    ):
                        if piecewise and k > 0:  # whoever reads the stream may have taken long over the one before
                            await check.again()
                        yield item

    async def _record_failure(
        self,
        error: ReplyParseError | UnsafeActionError | UnsupportedActionError | LanguageModelError,
        ended: Callable[..., Ended],
    ) -> None:
        """Keep what became of the question.

        Args:
            ended: called with what the question ended with.

        Raises:
            UnparsableReplyError, UnsafeReplyError, UnsupportedReplyError: for an error that does not carry the reply.
        """
        if isinstance(error, LanguageModelError):
            await self._record(ended("model_error", error=str(error)))
            return
        status, message, refusal = _refusal(error)
        failed = ended(status, error=message)
        id_ = await self._record(failed)
        raise refusal(failed.dialogue.reply_text or "", id_) from error


def _dialogue(question: Question, model: LanguageModel, timings_ms: Timings) -> AnyDialogue:
    if isinstance(question, ProgramQuestion):
        return ProgramDialogue(question, model, timings_ms)
    kind = SampledDialogue if question.samples else Dialogue
    return kind(question, model, timings_ms)


def _refusal(
    error: ReplyParseError | UnsafeActionError | UnsupportedActionError,
) -> tuple[PredictionStatus, str, Callable[[str, str], RoboPromptError]]:
    """How a reply that is not used is kept, why in words, and the error for it, once its text and id are known."""
    if isinstance(error, ReplyParseError):
        return "parse_error", error.message, partial(UnparsableReplyError, error.message)
    if isinstance(error, UnsafeActionError):
        return "unsafe_action", str(error), partial(UnsafeReplyError, error)
    return "unsupported", str(error), partial(UnsupportedReplyError, error)
