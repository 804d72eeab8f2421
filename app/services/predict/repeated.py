"""Answers to repeated requests: a request with the same idempotency key gets the answer of the first one."""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import anyio.to_thread
from sqlalchemy import Connection

from app.services.errors import RefusedReplyError
from app.services.predict.known import KnownReader
from app.services.predict.request import PredictRequest
from app.store import idempotency
from app.store.errors import ConflictError
from app.store.store import Store
from app.store.values import JsonObject
from app.store.visibility import present
from roboprompt_client.errors import UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard, action_from_json
from roboprompt_client.motion.limits import MAX_ACTIONS

MAX_WAIT_S = 60.0  # for the end of a request with the same key
FIRST_LOOK_S, LONGEST_BETWEEN_LOOKS_S = 0.02, 0.5  # pauses before it is asked whether that has ended


class RepeatedPredictions:
    """Remembers answers by key. Those to requests that failed are not remembered: asking again asks the LLM again.

    An answer is given only while its actions are within the task's limits of motion.
    """

    def __init__(self, store: Store, known: KnownReader) -> None:
        self._store, self._known = store, known

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
        limits = self._known.limits(connection, request.task)
        guard = MotionGuard(limits, MAX_ACTIONS, request.end_effector)
        try:
            for index, action in enumerate(answer["actions"]):
                guard.check(action_from_json(index, action))
        except UnsafeActionError as error:
            raise RefusedReplyError(error, answer["reply_text"], answer["id"]) from error
