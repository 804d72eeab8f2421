"""Language models for the threads of an evaluation."""

from contextlib import ExitStack
from types import TracebackType
from typing import Self

from anyio.from_thread import start_blocking_portal

from app.llm.base import Completion, CompletionRequest, complete
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry


class Models:
    """The models of a registry, asked from one event loop in a thread of its own. A context manager."""

    def __init__(self, settings: LlmSettings) -> None:
        self._settings = settings
        self._registry = ModelRegistry(settings)
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        self._portal = self._stack.enter_context(start_blocking_portal())
        self._stack.callback(lambda: self._portal.call(self._registry.aclose))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stack.close()

    def complete(self, name: str | None, request: CompletionRequest) -> tuple[str, Completion]:
        """The model's name and its reply. Blocking; safe for concurrent use.

        Args:
            name: None: the default model.

        Raises:
            LanguageModelError: if it cannot answer.
        """
        return self._portal.call(self._complete, name or self._settings.default_model, request)

    async def _complete(self, name: str, request: CompletionRequest) -> tuple[str, Completion]:
        async with self._registry.using(name) as model:
            return model.profile.name, await complete(model, request)
