"""`POST /predict`: observation and instruction -> actions, by an LLM that continues the demonstrations' pattern."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager

import anyio.to_thread

from app.llm.base import Reading, TextDelta
from app.llm.registry import ModelRegistry
from app.services.measures import timings, timings_of_its_own
from app.services.predict.known import KnownReader
from app.services.predict.motion_check import MotionCheck
from app.services.predict.part_reply import PredictedAction
from app.services.predict.question import Question, question_of
from app.services.predict.record import FAILURES, Prediction, PredictionRecorder
from app.services.predict.reply import Reply
from app.services.predict.request import PredictRequest
from app.services.predict.warm import PrefixWarmer
from app.store.store import Store
from roboprompt_client.errors import UnsafeActionError

Arriving = PredictedAction | TextDelta | Reading


class PredictActions:
    """Asks an LLM for actions. The event loop waits for nothing but the LLM; the rest runs in threads.

    Args:
        record: stores predictions; None: they are not stored, as those of `check`, which no robot carries out.
    """

    def __init__(
        self,
        store: Store,
        models: ModelRegistry,
        known: KnownReader,
        warmer: PrefixWarmer,
        record: PredictionRecorder | None,
    ) -> None:
        self._models, self._known, self._warmer, self._record = models, known, warmer, record

    async def __call__(self, request: PredictRequest) -> Prediction:
        """Return the recorded prediction, with timings of its own.

        Raises:
            as `prepare` and `complete`.
        """
        with timings_of_its_own():
            return await self.complete(await self.prepare(request))

    async def prepare(self, request: PredictRequest) -> Question:
        """Return the question to the LLM, with its prompt; raises as `question_of`."""
        return await anyio.to_thread.run_sync(question_of, request, self._known)

    async def complete(self, question: Question) -> Prediction:
        """Ask the LLM; return the whole prediction, recorded.

        Raises:
            LanguageModelError: if the LLM did not answer; recorded.
            RefusedReplyError: if its reply is not a list of valid actions, the demonstrations do not support an action,
                or an action breaks a present limit of motion; recorded, carries the reply.
        """
        motion = MotionCheck(self._known, question)
        async with self._asked(question) as reply, aclosing(reply.arriving(piecewise=False)) as arriving:
            async for item in arriving:
                if isinstance(item, list):
                    await motion.check([action.action for action in item])
                    timings().reached("first_action")
        return await self._recorded(reply, motion)

    async def stream(self, question: Question) -> AsyncGenerator[Arriving | Prediction, None]:
        """Yield each action (and, if requested, pieces of text) once it is complete, then the prediction, recorded.

        Raises:
            StoreUnavailableError: before the first action, if nothing can be recorded.
            as `complete`.
        """
        if self._record is not None:
            await self._record.require_writable(question.request.task)
        motion = MotionCheck(self._known, question)
        async with self._asked(question) as reply, aclosing(reply.arriving(piecewise=True)) as arriving:
            async for item in arriving:
                if isinstance(item, TextDelta | Reading):
                    yield item
                    continue
                await motion.check([action.action for action in item])
                for action in item:
                    await motion.check()  # the one before may have been read slowly
                    timings().reached("first_action")
                    yield action
        yield await self._recorded(reply, motion)

    @asynccontextmanager
    async def _asked(self, question: Question) -> AsyncIterator[Reply]:
        """Yield the reply for the block to read; meanwhile no prefix is read ahead."""
        async with self._models.using(question.known.profile.name) as model:
            reply = Reply(question, model)
            try:
                with self._warmer.giving_way():
                    yield reply
            except tuple(FAILURES) as error:
                if self._record is None:
                    raise
                await self._record.failed(reply, error)
                raise

    async def _recorded(self, reply: Reply, motion: MotionCheck) -> Prediction:
        if self._record is None:
            return Prediction("", reply, timings().ms, ())
        try:
            return await self._record.answered(reply, motion)
        except UnsafeActionError as error:  # beyond limits that were set after the last action came
            await self._record.failed(reply, error)
            raise
