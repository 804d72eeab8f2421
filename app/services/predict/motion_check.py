"""The present limits of motion, which every action of a reply and of a repeated answer must keep."""

import asyncio
import time
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager

import anyio.to_thread
from sqlalchemy import Connection

from app.services.cache import Cache
from app.services.errors import RefusedReplyError
from app.services.predict.question import Question
from app.services.predict.request import PredictRequest
from app.services.task_settings import TaskSettings
from app.store import idempotency, tasks
from app.store.errors import ConflictError
from app.store.records import TaskState
from app.store.store import Store
from app.store.values import JsonObject
from app.store.visibility import present
from roboprompt_client.errors import UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard, action_from_json
from roboprompt_client.motion.limits import MAX_ACTIONS, MotionLimits
from roboprompt_client.types.poses import EndEffectorAction

MAX_LIMITS = 64  # tasks whose limits are kept
MAX_WAIT_S = 60.0  # for the end of a request with the same key
FIRST_LOOK_S, LONGEST_BETWEEN_LOOKS_S = 0.02, 0.5  # pauses before it is asked whether that has ended


class CurrentLimits:
    """Reads the present limits of motion of tasks; of an unchanged task only its state is read."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._built: Cache[TaskState, MotionLimits] = Cache(MAX_LIMITS)

    def read(self, connection: Connection, task: str) -> MotionLimits:
        """The task's limits; raises NotFoundError if there is no such task."""

        def build() -> MotionLimits:
            return TaskSettings.of(connection, task).limits_of_motion()

        return self._built.get_or_make(tasks.state(connection, task), build)

    async def now(self, task: str) -> MotionLimits:
        """The same on a connection of its own, in a thread."""

        def read() -> MotionLimits:
            with self._store.read() as connection:
                return self.read(connection, task)

        return await anyio.to_thread.run_sync(read)


class MotionCheck:
    """Checks the actions of one answer by the limits of motion, and all of them again where those change.

    They may be tightened while an LLM writes. Each method raises UnsafeActionError for an action beyond a limit.
    """

    def __init__(self, current: CurrentLimits, question: Question) -> None:
        self._current, self._question = current, question
        self._actions: list[EndEffectorAction] = []
        self._limits = question.known.limits
        self._guard = self._guarding(self._limits)

    async def check(self, actions: Iterable[EndEffectorAction]) -> None:
        """Let the answer's next actions pass by the limits that were read last; `again` or `within` follows.

        Where these forbid an action, the present ones decide, which may be wider.
        """
        actions = list(actions)
        self._actions += actions
        try:
            for action in actions:
                self._guard.check(action)
        except UnsafeActionError:
            limits = await self._current.now(self._question.request.task)
            if limits == self._limits:
                raise
            self._apply(limits)

    async def again(self) -> None:
        """Check the actions so far by the limits of the moment."""
        self._apply(await self._current.now(self._question.request.task))

    def within(self, connection: Connection) -> None:
        self._apply(self._current.read(connection, self._question.request.task))

    def _apply(self, limits: MotionLimits) -> None:
        if limits == self._limits:
            return
        guard = self._guarding(limits)
        for action in self._actions:
            guard.check(action)
        self._limits, self._guard = limits, guard

    def _guarding(self, limits: MotionLimits) -> MotionGuard:
        return MotionGuard(limits, self._question.max_actions, self._question.known.end_effector)


class RepeatedPredictions:
    """Remembers answers by key. Those to requests that failed are not remembered: asking again asks the LLM again.

    An answer is given only while its actions are within the task's limits of motion.
    """

    def __init__(self, store: Store, limits: CurrentLimits) -> None:
        self._store = store
        self._limits = limits

    @asynccontextmanager
    async def alone(self, key: str) -> AsyncIterator[None]:
        """No other request of the caller with this key is under way in any process here: the first one asks the LLM.

        Raises:
            ConflictError: if another one is for longer than `MAX_WAIT_S`.
        """
        name = f"{idempotency.PREDICT} {present().key_id} {key}"
        deadline_s, pause_s = time.monotonic() + MAX_WAIT_S, FIRST_LOOK_S
        while (turn := await anyio.to_thread.run_sync(self._store.turns.take, name)) is None:
            if time.monotonic() > deadline_s:
                raise ConflictError(f"a request with the Idempotency-Key {key!r} is under way: send it again later")
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, LONGEST_BETWEEN_LOOKS_S)
        with turn:
            yield

    async def answer_to(self, key: str, digest: str, request: PredictRequest) -> JsonObject | None:
        """Return the stored answer to the same request; None if it is new.

        Args:
            digest: of the request's content.

        Raises:
            ConflictError: if the key came with other content.
            RefusedReplyError: if limits that were set since forbid one of the answer's actions.
        """

        def find() -> JsonObject | None:
            with self._store.read() as connection:
                stored = idempotency.find(connection, idempotency.PREDICT, key, digest)
                if stored is not None:
                    self._check(connection, request, stored)
                return stored

        return await anyio.to_thread.run_sync(find)

    async def remember(self, key: str, digest: str, request: PredictRequest, answer: JsonObject) -> JsonObject:
        """Remember the answer; of two requests that were under way at once, both get the first one's.

        Raises:
            ConflictError: if the key came with other content meanwhile.
            RefusedReplyError: as `answer_to`; nothing is remembered.
        """

        def save() -> JsonObject:
            with self._store.write() as connection:
                stored = idempotency.find(connection, idempotency.PREDICT, key, digest)
                given = answer if stored is None else stored
                self._check(connection, request, given)
                if stored is None:
                    idempotency.save(connection, idempotency.PREDICT, key, digest, answer)
            return given

        return await anyio.to_thread.run_sync(save)

    def _check(self, connection: Connection, request: PredictRequest, answer: JsonObject) -> None:
        limits = self._limits.read(connection, request.task)
        guard = MotionGuard(limits, MAX_ACTIONS, request.end_effector)
        try:
            for index, action in enumerate(answer["actions"]):
                guard.check(action_from_json(index, action))
        except UnsafeActionError as error:
            raise RefusedReplyError(error, answer["reply_text"], answer["id"]) from error
