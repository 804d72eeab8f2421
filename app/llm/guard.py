"""What a provider bears: places for so many requests at once, and a circuit that spares a dead one."""

import asyncio
import math
import sys
import time
from collections.abc import AsyncGenerator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass

from app.llm.base import ModelBusyError, ModelUnavailableError

BUSY_RETRY_AFTER_S = 1.0  # a reply takes a few seconds, and several are under way


@dataclass(frozen=True)
class Limits:
    """How a provider is treated."""

    concurrent: int  # requests at once
    queued: int  # requests that wait for a place; more are refused
    retries: int = 0  # how often it is asked again after an error that may pass
    backoff_s: float = 0.0  # wait before the first retry; doubles with each
    failures: int | None = None  # so many in a row open the circuit; None: it never opens
    pause_s: float = 0.0  # how long the circuit stays open
    each_model: bool = False  # these are the limits of each model rather than of all the provider's models together


NO_LIMITS = Limits(concurrent=sys.maxsize, queued=0)


class Guard:
    """The places and the circuit that the models of a provider share; its name is for messages."""

    def __init__(self, provider: str, limits: Limits, clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits
        self.places = Places(provider, limits)
        self.circuit = Circuit(provider, limits, clock)


class Places:
    """Lets `concurrent` requests in at once and lets `queued` more wait, first come, first served."""

    def __init__(self, provider: str, limits: Limits) -> None:
        self._provider = provider
        self._limits = limits
        self._free = asyncio.Semaphore(limits.concurrent)
        self._num_inside = 0

    @asynccontextmanager
    async def one(self) -> AsyncGenerator[None, None]:
        """A place, as soon as one is free; raises ModelBusyError."""
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

    def __init__(self, provider: str, limits: Limits, clock: Callable[[], float]) -> None:
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
        """Leave to ask; say inside whether the provider `answered` or `failed`. Raises ModelUnavailableError."""
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
        """The provider lives."""
        self._num_failures = 0

    def failed(self, reason: str) -> None:
        """The provider did not answer, or could not."""
        self._num_failures += 1
        self._last_failure = reason
        self._closes_at_s = self._clock() + self._limits.pause_s

    @property
    def _has_opened(self) -> bool:
        return self._limits.failures is not None and self._num_failures >= self._limits.failures
