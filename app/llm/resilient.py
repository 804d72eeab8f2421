"""Deadline, queue, retries and circuit breaker around a backend's model. The calls, outermost first:

ResilientModel.stream -> within_deadline   ends the request at its deadline
  _tries                                   waits for a free place (`Places`), then tries, with backoff between tries
    _try                                   tells the circuit breaker (`Circuit`) whether the provider answered
      the backend's stream

A request is sent again only where that may help, and no more often than the provider's limits allow.
"""

import asyncio
import math
import random
import sys
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator
from contextlib import aclosing, asynccontextmanager, contextmanager
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
    ModelUnavailableError,
    Pieces,
    Reading,
)

MAX_BACKOFF_S = 8.0
PATIENCE_S = 10.0  # a request that gave its provider less says nothing about the provider when it runs out of time
BUSY_RETRY_AFTER_S = 1.0  # a reply takes a few seconds, and several are under way


@dataclass(frozen=True)
class ProviderLimits:
    """Limits of the requests to a provider."""

    concurrent: int  # requests at once
    queued: int  # requests that wait for a place; more are refused
    retries: int = 0  # how often it is asked again after an error that may pass
    backoff_s: float = 0.0  # wait before the first retry; doubles with each
    failures: int | None = None  # so many in a row open the circuit; None: it never opens
    pause_s: float = 0.0  # how long the circuit stays open
    each_model: bool = False  # these are the limits of each model rather than of all the provider's models together


NO_LIMITS = ProviderLimits(concurrent=sys.maxsize, queued=0)


class Guard:
    """The places and the circuit that the models of a provider share; its name is for messages."""

    def __init__(self, provider: str, limits: ProviderLimits, clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits
        self.places = Places(provider, limits)
        self.circuit = Circuit(provider, limits, clock)


class Places:
    """Lets `concurrent` requests in at once and lets `queued` more wait, first come, first served."""

    def __init__(self, provider: str, limits: ProviderLimits) -> None:
        self._provider = provider
        self._limits = limits
        self._free = asyncio.Semaphore(limits.concurrent)
        self._num_inside = 0

    @asynccontextmanager
    async def one(self) -> AsyncGenerator[None, None]:
        """Hold a place, waiting for a free one; raises ModelBusyError if too many wait."""
        if self._num_inside >= self._limits.concurrent + self._limits.queued:
            taken = f"{self._limits.concurrent} requests are under way and {self._limits.queued} wait"
            raise ModelBusyError(f"{self._provider} is busy: {taken}", retry_after_s=BUSY_RETRY_AFTER_S)
        self._num_inside += 1
        try:
            async with self._free:
                yield
        finally:
            self._num_inside -= 1


class Circuit:
    """Opens after so many failures in a row; after a pause lets one request through, whose outcome decides."""

    def __init__(self, provider: str, limits: ProviderLimits, clock: Callable[[], float]) -> None:
        self._provider = provider
        self._limits = limits
        self._clock = clock
        self._num_failures = 0
        self._last_failure = ""
        self._closes_at_s = -math.inf
        self._trial_under_way = False

    @property
    def is_open(self) -> bool:
        """Whether no request may pass at present."""
        return self._has_opened and (self._trial_under_way or self._clock() < self._closes_at_s)

    @contextmanager
    def passage(self) -> Iterator[None]:
        """Let a request pass, inside which `answered` or `failed` is called. Raises ModelUnavailableError if open."""
        if self.is_open:
            wait_s = max(self._closes_at_s - self._clock(), 1.0)
            raise ModelUnavailableError(
                f"{self._provider} failed {self._num_failures} times in a row and is not asked for another "
                f"{wait_s:.0f} s; the last time: {self._last_failure}",
                retry_after_s=wait_s,
            )
        on_trial = self._has_opened
        self._trial_under_way |= on_trial
        try:
            yield
        finally:
            if on_trial:
                self._trial_under_way = False

    def answered(self) -> None:
        """Note that the provider answered."""
        self._num_failures = 0

    def failed(self, reason: str) -> None:
        """Note that the provider did not answer, or answered with an error of its own."""
        self._num_failures += 1
        self._last_failure = reason
        self._closes_at_s = self._clock() + self._limits.pause_s

    @property
    def _has_opened(self) -> bool:
        return self._limits.failures is not None and self._num_failures >= self._limits.failures


class ResilientModel:
    """A backend's model as requests reach it.

    Retries happen before the first piece of a stream only: what a robot has begun to execute is not asked for again. A
    reply that is wanted whole is asked for again when it breaks off, too.
    Everything, waiting included, happens within the request's deadline.

    Args:
        guard: shared by the models of a provider.
        sleep, jitter: waits; a random number in [0, 1).
    """

    def __init__(
        self,
        model: LanguageModel,
        guard: Guard,
        *,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
        jitter: Callable[[], float] = random.random,
    ) -> None:
        self.model = model
        self.profile = model.profile
        self._guard = guard
        self._sleep = sleep
        self._jitter = jitter

    def stream(self, request: CompletionRequest) -> Pieces:
        return within_deadline(self._tries(request), request.timeout_s, self.profile.name)

    async def aclose(self) -> None:
        await self.model.aclose()

    async def _tries(self, request: CompletionRequest) -> Pieces:
        deadline_s = anyio.current_time() + request.timeout_s
        async with self._guard.places.one():
            for num_retries in count():
                started = False
                try:
                    async with aclosing(self._try(request)) as pieces:
                        async for piece in pieces:
                            started = started or not isinstance(piece, Reading)
                            yield piece
                    return
                except LanguageModelError as error:
                    wait_s = self._wait_s(error, num_retries)
                    if started or wait_s is None or anyio.current_time() + wait_s >= deadline_s:
                        raise
                await self._sleep(wait_s)

    async def _try(self, request: CompletionRequest) -> Pieces:
        """Yield the reply to one try, and report its outcome to the circuit."""
        circuit, asked_s, silent = self._guard.circuit, anyio.current_time(), True
        with circuit.passage():
            try:
                async with aclosing(self.model.stream(request)) as pieces:
                    async for piece in pieces:
                        if silent:
                            circuit.answered()
                        silent = False
                        if request.piecewise or isinstance(piece, Completion):
                            yield piece
                        if isinstance(piece, Completion):
                            return
                raise ModelResponseError(INCOMPLETE)
            except ModelTimeoutError:
                raise
            except LanguageModelError as error:
                if silent and error.retryable and not isinstance(error, ModelBusyError):
                    circuit.failed(str(error))
                elif silent:
                    circuit.answered()
                silent = False
                raise
            finally:
                passed_s = anyio.current_time() - asked_s
                if silent and passed_s >= PATIENCE_S:
                    circuit.failed(f"no answer within {passed_s:.0f} s")

    def _wait_s(self, error: LanguageModelError, num_retries: int) -> float | None:
        """Return the wait before the next try; None if there is none."""
        limits = self._guard.limits
        if not error.retryable or num_retries >= limits.retries or self._guard.circuit.is_open:
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
