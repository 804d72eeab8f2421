"""Deadline, queue and retries around a backend's model. The calls, outermost first:

ResilientModel.stream -> within_deadline   ends the request at its deadline
  _tries                                   waits for a free place (`Places`), then tries, with backoff between tries
    the backend's stream

A request is sent again only where that may help, and no more often than the provider's limits allow.
"""

import asyncio
import random
import sys
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass
from itertools import count

import anyio

from app.llm.base import (
    INCOMPLETE,
    Completion,
    CompletionRequest,
    LanguageModel,
    LanguageModelError,
    ModelBusyError,
    ModelResponseError,
    ModelTimeoutError,
    Pieces,
    Reading,
)

MAX_BACKOFF_S = 8.0
BUSY_RETRY_AFTER_S = 1.0  # a reply takes a few seconds, and several are under way


@dataclass(frozen=True)
class ProviderLimits:
    """Limits of the requests to a provider."""

    concurrent: int  # requests at once
    queued: int  # requests that wait for a place; more are refused
    retries: int = 0  # how often it is asked again after an error that may pass
    backoff_s: float = 0.0  # wait before the first retry; doubles with each
    each_model: bool = False  # these are the limits of each model rather than of all the provider's models together


NO_LIMITS = ProviderLimits(concurrent=sys.maxsize, queued=0)


class Places:
    """Lets `concurrent` requests in at once and lets `queued` more wait, first come, first served.

    The models of a provider share them; its name is for messages.
    """

    def __init__(self, provider: str, limits: ProviderLimits) -> None:
        self.limits = limits
        self._provider = provider
        self._free = asyncio.Semaphore(limits.concurrent)
        self._num_inside = 0

    @asynccontextmanager
    async def one(self) -> AsyncGenerator[None, None]:
        """Hold a place, waiting for a free one; raises ModelBusyError if too many wait."""
        if self._num_inside >= self.limits.concurrent + self.limits.queued:
            taken = f"{self.limits.concurrent} requests are under way and {self.limits.queued} wait"
            raise ModelBusyError(f"{self._provider} is busy: {taken}", retry_after_s=BUSY_RETRY_AFTER_S)
        self._num_inside += 1
        try:
            async with self._free:
                yield
        finally:
            self._num_inside -= 1


class ResilientModel:
    """A backend's model as requests reach it.

    Retries happen before the first piece only: what a robot has begun to execute is not asked for again.
    Everything, waiting included, happens within the request's deadline.

    Args:
        sleep, jitter: waits; a random number in [0, 1).
    """

    def __init__(
        self,
        model: LanguageModel,
        places: Places,
        *,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
        jitter: Callable[[], float] = random.random,
    ) -> None:
        self.model = model
        self.profile = model.profile
        self._places = places
        self._sleep = sleep
        self._jitter = jitter

    def stream(self, request: CompletionRequest) -> Pieces:
        return within_deadline(self._tries(request), request.timeout_s, self.profile.name)

    async def aclose(self) -> None:
        await self.model.aclose()

    async def _tries(self, request: CompletionRequest) -> Pieces:
        deadline_s = anyio.current_time() + request.timeout_s
        async with self._places.one():
            for num_retries in count():
                started = False
                try:
                    async with aclosing(self.model.stream(request)) as pieces:
                        async for piece in pieces:
                            started = started or not isinstance(piece, Reading)
                            yield piece
                            if isinstance(piece, Completion):
                                return
                    raise ModelResponseError(INCOMPLETE)
                except LanguageModelError as error:
                    wait_s = self._wait_s(error, num_retries)
                    if started or wait_s is None or anyio.current_time() + wait_s >= deadline_s:
                        raise
                await self._sleep(wait_s)

    def _wait_s(self, error: LanguageModelError, num_retries: int) -> float | None:
        """Return the wait before the next try; None if there is none."""
        limits = self._places.limits
        if not error.retryable or num_retries >= limits.retries:
            return None
        backoff_s = min(limits.backoff_s * 2.0**num_retries, MAX_BACKOFF_S) * (1 + self._jitter()) / 2
        return max(backoff_s, error.retry_after_s or 0.0)


async def within_deadline(pieces: Pieces, timeout_s: float, model: str) -> Pieces:
    """`pieces` as they come; `timeout_s` after the first was asked for it closes them and raises ModelTimeoutError."""
    # The deadline surrounds each wait but no `yield`: there it would interrupt the consumer instead (PEP 789). It is
    # anyio's and not asyncio's: httpx shields the closing of a connection from the former only.
    deadline = anyio.current_time() + timeout_s
    async with aclosing(pieces):
        while True:
            with anyio.CancelScope(deadline=deadline) as scope:
                piece = await anext(pieces, None)
            if scope.cancelled_caught:
                raise ModelTimeoutError(f"{model} did not answer within {timeout_s:g} s")
            if piece is None:
                return
            yield piece
