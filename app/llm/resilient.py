"""A wrapper that asks a model again where that may help, and no more often than its provider bears."""

import asyncio
import random
from collections.abc import Awaitable, Callable
from contextlib import aclosing
from functools import partial
from itertools import count

from app.llm.base import (
    Completion,
    CompletionRequest,
    LanguageModel,
    LanguageModelError,
    ModelBusyError,
    ModelProfile,
    ModelTimeoutError,
)
from app.llm.guard import Guard
from app.llm.streaming import Pieces, in_one_piece, whole_within_deadline, within_deadline

_Ask = Callable[[CompletionRequest], Pieces]
MAX_BACKOFF_S = 8.0
PATIENCE_S = 10.0  # a request that gave its provider less says nothing about the provider when it runs out of time


class ResilientModel:
    """A model behind a guard: a place among the concurrent requests, retries, and the circuit.

    Retries happen before the first piece of a stream only: what a robot has begun to execute is not asked for again. A
    whole reply that breaks off is.
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
        self._model = model
        self._guard = guard
        self._sleep = sleep
        self._jitter = jitter

    @property
    def profile(self) -> ModelProfile:
        return self._model.profile

    def stream(self, request: CompletionRequest) -> Pieces:
        return within_deadline(self._pieces(request, self._model.stream), request.timeout_s, self.profile.name)

    async def complete(self, request: CompletionRequest) -> Completion:
        pieces = self._pieces(request, partial(in_one_piece, self._model))
        return await whole_within_deadline(pieces, request.timeout_s, self.profile.name)

    async def aclose(self) -> None:
        await self._model.aclose()

    async def _pieces(self, request: CompletionRequest, ask: _Ask) -> Pieces:
        deadline_s = _now_s() + request.timeout_s
        async with self._guard.places.one():
            for num_retries in count():
                started = False
                try:
                    async with aclosing(self._attempt(request, ask)) as pieces:
                        async for piece in pieces:
                            started = True
                            yield piece
                    return
                except LanguageModelError as error:
                    wait_s = self._wait_s(error, num_retries)
                    if started or wait_s is None or _now_s() + wait_s >= deadline_s:
                        raise
                await self._sleep(wait_s)

    async def _attempt(self, request: CompletionRequest, ask: _Ask) -> Pieces:
        """The reply to one try; the circuit learns how it went."""
        circuit, asked_s, silent = self._guard.circuit, _now_s(), True
        with circuit.passage():
            try:
                async with aclosing(ask(request)) as pieces:
                    async for piece in pieces:
                        if silent:
                            circuit.answered()
                        silent = False
                        yield piece
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
                if silent and _now_s() - asked_s >= PATIENCE_S:
                    circuit.failed(f"no answer within {_now_s() - asked_s:.0f} s")

    def _wait_s(self, error: LanguageModelError, num_retries: int) -> float | None:
        """How long to wait before the next try; None if there is to be none."""
        limits = self._guard.limits
        if not error.retryable or num_retries >= limits.retries or self._guard.circuit.is_open:
            return None
        backoff_s = min(limits.backoff_s * 2.0**num_retries, MAX_BACKOFF_S) * (1 + self._jitter()) / 2
        return max(backoff_s, error.retry_after_s or 0.0)


def _now_s() -> float:
    return asyncio.get_running_loop().time()
