"""A model on this machine: llama.cpp in a child process, asked through its OpenAI-compatible port.

Started by the first request or by `warm_up`.
"""

import asyncio
import importlib.util
import logging
import math
import re
from collections import OrderedDict
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, aclosing, asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import anyio

from app.executors import usable_cores
from app.llm.base import (
    QUICK_S,
    CompletionRequest,
    LanguageModel,
    LanguageModelError,
    ModelProfile,
    ModelUnavailableError,
    Pieces,
)
from app.llm.llama.process import GivenLlama, LlamaOptions, LlamaProcess, given_to_children, launch
from app.llm.llama.vocabulary import TrimmedModel
from app.llm.llama.weights import GEMMA, Weights, find_weights, trimmed_gemma
from app.llm.llm_settings import LlmSettings
from app.llm.openai_compatible import OWN_LLAMA_CPP, OpenAiCompatibleModel

DYING_S = 1.0  # frees some hundred MB
# Reading ten demonstrations takes as long on two cores; another slot that knows them hardly speeds replies up there.
PATIENCE_S = 5.0
Process = LlamaProcess | GivenLlama
logger = logging.getLogger(__name__)
# Files of models that were trained to follow instructions, as publishers name them; base models continue rows.
INSTRUCTED = re.compile(r"[-_.](instruct|it|chat)[-_.]", re.IGNORECASE)
# Twice what two busy cores took with a model of 1.5 B parameters: for a reply, and for 1,000 characters of a prompt.
SLOW_S, SLOW_READING_S = 120.0, 75.0


def embedded_model(model: str, settings: LlmSettings) -> LanguageModel:
    """Gemma, or the GGUF file of that path; starts nothing. Raises UnknownModelError, ModelUnavailableError."""
    weights = find_weights(model, settings.cache_folder)
    if importlib.util.find_spec("xllamacpp") is None:
        raise ModelUnavailableError("embedded models need llama.cpp: pip install xllamacpp")
    whole = EmbeddedModel(embedded_profile(model), weights, settings)
    if model != GEMMA:
        return whole
    return TrimmedModel(EmbeddedModel(whole.profile, trimmed_gemma(settings.cache_folder), settings), whole)


def embedded_profile(model: str) -> ModelProfile:
    """How the model of that name or path is asked best (docs/results/llm.md)."""
    chat = bool(INSTRUCTED.search(Path(model).name))
    return ModelProfile(
        name=f"embedded/{model}",
        style="chat" if chat else "completion",
        grammar=True,
        representation="object_frame",
        prompt_format="sums" if chat else "paper",  # of absolute rows
        system_prompt="a" if chat else "none",
        description=f"{'Gemma 3 270M base, Q4_K_M' if model == GEMMA else 'A GGUF file'}, on this machine",
        timeout_s=SLOW_S if chat else QUICK_S,
        reading_s=SLOW_READING_S if chat else 0.0,
    )


@contextmanager
def shared_by_workers(settings: LlmSettings) -> Iterator[None]:
    """Run the default model, if it is embedded, for the worker processes that are started inside the block."""
    backend, _, model = settings.default_model.partition("/")
    with ExitStack() as stack:
        if backend == "embedded":
            try:
                weights = (trimmed_gemma if model == GEMMA else partial(find_weights, model))(settings.cache_folder)
                stack.enter_context(given_to_children(llama_options(weights(), settings)))
            except LanguageModelError as error:  # requests get it as their answer
                logger.warning("the default model is not available: %s", error)
        yield


class EmbeddedModel:
    """One GGUF model, served by one child process, as the settings `embedded_...` say."""

    def __init__(self, profile: ModelProfile, weights: Weights, settings: LlmSettings) -> None:
        self.profile = profile
        self._weights = weights
        self._settings = settings
        self._slots = WarmSlots(settings.embedded_slots)
        self._start: asyncio.Task[Process] | None = None
        self._closed = False

    async def stream(self, request: CompletionRequest) -> Pieces:
        process = await self._running()
        client = OpenAiCompatibleModel(self.profile, process.server, self.profile.name, OWN_LLAMA_CPP)
        try:
            async with self._slots.turn(request.cache_key), aclosing(client.stream(request)) as pieces:
                async for piece in pieces:
                    yield piece
        except LanguageModelError as error:
            if error.retryable:
                # A process that dies closes its connections first; the next request must find it dead.
                await asyncio.to_thread(process.ends_within, DYING_S)
            raise

    async def warm_up(self) -> None:
        """Start it unless it runs; the event loop goes on. Raises ModelUnavailableError if it cannot be served."""
        await self._running()

    async def aclose(self) -> None:
        self._closed = True
        if self._start:
            await _stop(self._start)

    async def _running(self) -> Process:
        """The server, which all callers start together; one that failed or died is started again."""
        if self._closed:
            raise ModelUnavailableError(f"{self.profile.name} is closed")
        if self._start is None or _has_ended(self._start):
            self._start = asyncio.create_task(self._started(self._start))
        # a caller that gives up must not stop the start that others wait for
        return await asyncio.shield(self._start)

    async def _started(self, ended: asyncio.Task[Process] | None) -> Process:
        if ended:
            await _stop(ended)
        return await asyncio.to_thread(lambda: launch(llama_options(self._weights(), self._settings)))


def llama_options(model: Path, settings: LlmSettings) -> LlamaOptions:
    """How a GGUF file is served; its key is new."""
    slots, threads = settings.embedded_slots, settings.embedded_threads or usable_cores()
    return LlamaOptions(str(model), slots, settings.embedded_context_tokens, threads)


def _has_ended(start: asyncio.Task[Process]) -> bool:
    """Whether the start failed or the process died since."""
    return start.done() and (start.exception() is not None or not start.result().running)


async def _stop(start: asyncio.Task[Process]) -> None:
    await asyncio.wait([start])
    if start.exception() is None:
        await asyncio.to_thread(start.result().stop)


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
