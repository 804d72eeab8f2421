"""What every request passes through on its way to a backend, drawn from the outside in.

    stream -> within_deadline     the only deadline; nothing outside it but a recording (`recorded`)
      _tries                      a place (`guard.Places`), then one try after the other, with waits between
        _try                      the circuit (`guard.Circuit`) learns how it goes; a reply that is wanted whole is
                                  one piece, its Completion
          the backend's stream

A model is asked again where that may help, and no more often than its provider bears.
"""

import asyncio
import random
from collections.abc import Awaitable, Callable
from contextlib import aclosing
from itertools import count

import anyio

from app.llm.base import (
    INCOMPLETE,
    Completion,
    CompletionRequest,
    LanguageModel,
    LanguageModelError,
    ModelBusyError,
    ModelProfile,
    ModelResponseError,
    ModelTimeoutError,
    Pieces,
    Reading,
)
from app.llm.guard import Guard

MAX_BACKOFF_S = 8.0
PATIENCE_S = 10.0  # a request that gave its provider less says nothing about the provider when it runs out of time


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
        self._model = model
        self._guard = guard
        self._sleep = sleep
        self._jitter = jitter

    @property
    def profile(self) -> ModelProfile:
        return self._model.profile

    def stream(self, request: CompletionRequest) -> Pieces:
        return within_deadline(self._tries(request), request.timeout_s, self.profile.name)

    async def aclose(self) -> None:
        await self._model.aclose()

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
        """The reply to one try; the circuit learns how it went."""
        circuit, asked_s, silent = self._guard.circuit, anyio.current_time(), True
        with circuit.passage():
            try:
                async with aclosing(self._model.stream(request)) as pieces:
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
        """How long to wait before the next try; None if there is to be none."""
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
