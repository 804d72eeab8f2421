"""A model on this machine: llama.cpp in a child process, asked through its OpenAI-compatible port.

The text is continued raw, without a chat template: the small models it is meant for are base models, or behave better
as such. Started by the first request or by `warm_up`.
"""

import asyncio
import math
from collections import OrderedDict
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import anyio

from app.executors import usable_cores
from app.llm.base import CompletionRequest, LanguageModelError, ModelProfile, ModelUnavailableError, Pieces
from app.llm.llama.process import LlamaOptions, LlamaProcess, SharedLlama
from app.llm.llama.weights import Weights
from app.llm.llm_settings import LlmSettings
from app.llm.openai_compatible import OWN_LLAMA_CPP, OpenAiCompatibleModel

DYING_S = 1.0  # frees some hundred MB
# Reading ten demonstrations takes as long on two cores; another slot that knows them hardly speeds replies up there.
PATIENCE_S = 5.0


@dataclass(frozen=True)
class _Running:
    process: LlamaProcess | SharedLlama
    client: OpenAiCompatibleModel


class EmbeddedModel:
    """One GGUF model, served by one child process, as the settings `embedded_...` say."""

    def __init__(self, profile: ModelProfile, weights: Weights, settings: LlmSettings) -> None:
        self.profile = profile
        self._weights = weights
        self._settings = settings
        self._slots = WarmSlots(settings.embedded_slots)
        self._start: asyncio.Task[_Running] | None = None
        self._closed = False

    async def stream(self, request: CompletionRequest) -> Pieces:
        running = await self._running()
        try:
            async with self._slots.turn(request.cache_key), aclosing(running.client.stream(request)) as pieces:
                async for piece in pieces:
                    yield piece
        except LanguageModelError as error:
            if error.retryable:
                # A process that dies closes its connections first; the next request must find it dead.
                await asyncio.to_thread(running.process.ends_within, DYING_S)
            raise

    async def warm_up(self) -> None:
        """Start it unless it runs; the event loop goes on. Raises ModelUnavailableError if it cannot be served."""
        await self._running()

    async def aclose(self) -> None:
        self._closed = True
        if self._start:
            await _stop(self._start)

    async def _running(self) -> _Running:
        """The server, which all callers start together; one that failed or died is started again."""
        if self._closed:
            raise ModelUnavailableError(f"{self.profile.name} is closed")
        if self._start is None or _has_ended(self._start):
            self._start = asyncio.create_task(self._started(self._start))
        # a caller that gives up must not stop the start that others wait for
        return await asyncio.shield(self._start)

    async def _started(self, ended: asyncio.Task[_Running] | None) -> _Running:
        if ended:
            await _stop(ended)
        path = await asyncio.to_thread(self._weights)
        options = LlamaOptions(
            model=str(path),
            slots=self._settings.embedded_slots,
            context_tokens=self._settings.embedded_context_tokens,
            threads=self._settings.embedded_threads or usable_cores(),
            kept_folder=str(self._settings.embedded_kept_folder or ""),
        )
        process = await asyncio.to_thread(_launch, options, self._settings.embedded_shared_folder)
        client = OpenAiCompatibleModel(self.profile, process.server, self.profile.name, OWN_LLAMA_CPP)
        return _Running(process, client)


def _launch(options: LlamaOptions, shared_folder: Path | None) -> LlamaProcess | SharedLlama:
    return SharedLlama(options, shared_folder) if shared_folder else LlamaProcess(options)


def _has_ended(start: asyncio.Task[_Running]) -> bool:
    """Whether the start failed or the process died since."""
    return start.done() and (start.exception() is not None or not start.result().process.running)


async def _stop(start: asyncio.Task[_Running]) -> None:
    await asyncio.wait([start])
    if start.exception() is None:
        running = start.result()
        await running.client.aclose()
        await asyncio.to_thread(running.process.stop)


class WarmSlots:
    """Lets a request wait for a slot that knows its prefix, rather than read the prefix again in another slot.

    llama.cpp itself picks the idle slot that shares most of a prompt, but of the requests that come at once each gets
    another slot: four robots that begin together would each wait until all four slots have read the same. A request
    that has waited for `PATIENCE_S` takes a further slot, so that lasting demand spreads out. Used from one event loop.

    Args:
        slots: of the server; so many prefixes are remembered, the most recently used ones.
    """

    def __init__(self, slots: int) -> None:
        self._slots = slots
        self._lanes: OrderedDict[str, _Lane] = OrderedDict()

    @asynccontextmanager
    async def turn(self, prefix: str) -> AsyncIterator[None]:
        """Inside the block the request has one of the slots that know the prefix; an empty prefix waits for none."""
        if not prefix:
            yield
            return
        lane = self._lane(prefix)
        await self._enter(lane)
        try:
            yield
        finally:
            lane.free.release()

    async def _enter(self, lane: "_Lane") -> None:
        with anyio.move_on_after(PATIENCE_S if lane.known < self._slots else math.inf) as waiting:
            await lane.free.acquire()
        if not waiting.cancelled_caught:
            return
        if lane.known < self._slots:
            lane.known += 1  # a slot that does not know the prefix yet
        else:
            await lane.free.acquire()

    def _lane(self, prefix: str) -> "_Lane":
        lane = self._lanes.setdefault(prefix, _Lane())
        self._lanes.move_to_end(prefix)
        while len(self._lanes) > self._slots:
            self._lanes.popitem(last=False)
        return lane


@dataclass
class _Lane:
    """The slots that know a prefix: how many, and those that are free, first come, first served."""

    known: int = 1
    free: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(1))
