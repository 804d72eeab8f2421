"""A model on this machine: llama.cpp in a child process, asked through its OpenAI-compatible port.

The text is continued raw, without a chat template: the small models it is meant for are base models, or behave better
as such. Started by the first request or by `warm_up`.
"""

import asyncio
import os
from contextlib import aclosing
from dataclasses import dataclass
from pathlib import Path

from app.llm.base import CompletionRequest, LanguageModelError, ModelProfile, ModelUnavailableError, Pieces
from app.llm.llama.process import LlamaOptions, LlamaProcess, SharedLlama
from app.llm.llama.warm_slots import WarmSlots
from app.llm.llama.weights import Weights
from app.llm.openai_compatible import LLAMA_CPP, OpenAiCompatibleModel

DYING_S = 1.0  # frees some hundred MB


@dataclass(frozen=True)
class EmbeddedOptions:
    """How an embedded model is served.

    Attributes:
        threads: CPU threads; None for one per core that this process may use.
        slots: requests answered at once; each keeps the prefix of its last prompt.
        context_tokens: longest prompt plus reply of a slot.
        shared_folder: where processes tell each other of running models; None: this process has its own.
    """

    threads: int | None = None
    slots: int = 4
    context_tokens: int = 8192
    shared_folder: Path | None = None


@dataclass(frozen=True)
class _Running:
    process: LlamaProcess | SharedLlama
    client: OpenAiCompatibleModel


class EmbeddedModel:
    """One GGUF model, served by one child process."""

    def __init__(self, profile: ModelProfile, weights: Weights, options: EmbeddedOptions) -> None:
        self._profile = profile
        self._weights = weights
        self._options = options
        self._slots = WarmSlots(options.slots)
        self._start: asyncio.Task[_Running] | None = None
        self._closed = False

    @property
    def profile(self) -> ModelProfile:
        return self._profile

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
        """Start the model unless it runs; the event loop goes on meanwhile.

        Raises:
            ModelUnavailableError: if the weights are missing or llama.cpp cannot serve them.
        """
        await self._running()

    async def aclose(self) -> None:
        self._closed = True
        if self._start:
            await _stop(self._start)

    async def _running(self) -> _Running:
        """The server, which all callers start together; one that failed or died is started again."""
        if self._closed:
            raise ModelUnavailableError(f"{self._profile.name} is closed")
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
            slots=self._options.slots,
            context_tokens=self._options.context_tokens,
            threads=self._options.threads or usable_cores(),
        )
        process, api_key = await asyncio.to_thread(_launch, options, self._options.shared_folder)
        client = OpenAiCompatibleModel(
            self._profile,
            process.base_url,
            self._profile.name,
            api_key,
            quirks=LLAMA_CPP,
            trust_env=False,  # no proxy stands before the loopback
        )
        return _Running(process, client)


def _launch(options: LlamaOptions, shared_folder: Path | None) -> tuple[LlamaProcess | SharedLlama, str]:
    """A server and its key."""
    if shared_folder is None:
        return LlamaProcess(options), options.api_key
    shared = SharedLlama(options, shared_folder)
    return shared, shared.api_key


def _has_ended(start: asyncio.Task[_Running]) -> bool:
    """Whether the start failed or the process died since."""
    return start.done() and (start.exception() is not None or not start.result().process.running)


async def _stop(start: asyncio.Task[_Running]) -> None:
    await asyncio.wait([start])
    if start.exception() is None:
        running = start.result()
        await running.client.aclose()
        await asyncio.to_thread(running.process.stop)


def usable_cores() -> int:
    """The cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
