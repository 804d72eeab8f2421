"""Lets an embedded model read prefixes ahead of the predictions that need them."""

import asyncio
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

import anyio
import anyio.to_thread

from app.llm.base import CompletionRequest, LanguageModelError, complete
from app.llm.registry import ModelRegistry
from app.pipeline.prompt import Prompt
from app.services.predict.known import KnownReader
from app.services.predict.prefix import usual_prefixes
from app.store import tasks
from app.store.store import Store
from roboprompt_client.errors import RoboPromptError

DEBOUNCE_S = 1.0  # episodes are uploaded one after the other, and each changes the prefix
TIMEOUT_S = 600.0  # no robot waits: a prediction ends it
logger = logging.getLogger(__name__)


class PrefixWarmer:
    """Sends the default model the prefixes of tasks: the most recently used at start-up, each again when it changes.

    One at a time, and only while no prediction is under way: one that begins ends the request, which is sent again
    later and then finds in the model's cache what had been read. All of it happens on the event loop of `run`, but
    `changed` may be called in any thread.

    Args:
        num_tasks: so many of the most recently used tasks; the model keeps as many prefixes.
    """

    def __init__(self, store: Store, models: ModelRegistry, known: KnownReader, num_tasks: int) -> None:
        self._store = store
        self._models = models
        self._known = known
        self._num_tasks = num_tasks
        self._due_s: dict[str, float] = {}  # by task, by time.monotonic
        self._work = asyncio.Event()
        self._idle = asyncio.Event()
        self._idle.set()
        self._num_predictions = 0
        # Anyio's, which may be cancelled twice: a second cancellation of a task would interrupt httpx's tidying up.
        self._reading: anyio.CancelScope | None = None  # the last request's; made on an event loop only
        self._loop: asyncio.AbstractEventLoop | None = None  # while `run` runs

    def changed(self, task: str) -> None:
        """Note that the task's demonstrations or settings have changed; without effect while `run` does not run."""
        if (loop := self._loop) is not None:
            loop.call_soon_threadsafe(self._put_off, task)

    def _put_off(self, task: str) -> None:
        self._due_s[task] = time.monotonic() + DEBOUNCE_S
        self._work.set()

    @contextmanager
    def giving_way(self) -> Iterator[None]:
        self._num_predictions += 1
        self._idle.clear()
        if self._reading is not None:
            self._reading.cancel()
        try:
            yield
        finally:
            self._num_predictions -= 1
            if self._num_predictions == 0:
                self._idle.set()

    async def run(self) -> None:
        """Start the default model and keep it warm, until cancelled; gives up if the model is not available."""
        self._loop = asyncio.get_running_loop()
        try:
            await self._run()
        finally:
            self._loop = None

    async def _run(self) -> None:
        try:
            if not await self._models.warm_up():
                return
        except LanguageModelError as error:
            logger.warning("the default model is not available: %s", error)
            return
        for name in await anyio.to_thread.run_sync(self._recent):
            self._due_s.setdefault(name, time.monotonic())
        while True:
            await self._warm_next()

    def _recent(self) -> tuple[str, ...]:
        with self._store.read() as connection:
            return tasks.most_recently_used(connection, self._num_tasks)

    async def _warm_next(self) -> None:
        """Wait for what is due, and for the robots; then warm it."""
        if not self._due_s:
            self._work.clear()
            await self._work.wait()
        task, due_s = min(self._due_s.items(), key=lambda item: item[1])
        if (wait_s := due_s - time.monotonic()) > 0:
            await asyncio.sleep(wait_s)  # an upload meanwhile puts it off
            return
        while self._num_predictions:  # the next one may have begun since the last one ended
            await self._idle.wait()
        with anyio.CancelScope() as reading:
            self._reading = reading
            await self._read(task)
        if not reading.cancelled_caught and self._due_s.get(task) == due_s:
            del self._due_s[task]

    async def _read(self, task: str) -> None:
        """Let the model read the prefixes of the task's usual plans, the most usual last: it is forgotten last.

        An error here is only logged: a robot that asks gets it as the answer.
        """
        try:
            for prefix in reversed(await anyio.to_thread.run_sync(lambda: usual_prefixes(*self._known.usual(task)))):
                prompt = Prompt(prefix.template.system, prefix.template.prefix, "")
                request = CompletionRequest(prompt, max_tokens=1, timeout_s=TIMEOUT_S, cache_key=prefix.cache_key)
                await complete(self._models.get(), request)
        except RoboPromptError as error:
            logger.info("the prefix of task %s is not warm: %s", task, error)
