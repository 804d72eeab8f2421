"""Backends without an LLM: the reply is computed from the request, in milliseconds."""

import asyncio
from collections.abc import Callable

from app.llm.base import Completion, CompletionRequest, ModelProfile
from app.llm.streaming import Pieces, cut, spoken, whole_within_deadline, within_deadline


class ComputedModel:
    """Computes each reply from its request.

    Args:
        reply_to: may raise a LanguageModelError.
        delay_s: before each word.
    """

    def __init__(
        self, profile: ModelProfile, reply_to: Callable[[CompletionRequest], str], *, delay_s: float = 0.0
    ) -> None:
        self._profile = profile
        self._reply_to = reply_to
        self._delay_s = delay_s

    @property
    def profile(self) -> ModelProfile:
        return self._profile

    def stream(self, request: CompletionRequest) -> Pieces:
        return within_deadline(self._pieces(request), request.timeout_s, self._profile.name)

    async def complete(self, request: CompletionRequest) -> Completion:
        return await whole_within_deadline(self._in_one_piece(request), request.timeout_s, self._profile.name)

    async def aclose(self) -> None:
        """Nothing is held."""

    async def _pieces(self, request: CompletionRequest) -> Pieces:
        async for piece in spoken(cut(self._reply_to(request), request), self._delay_s):
            yield piece

    async def _in_one_piece(self, request: CompletionRequest) -> Pieces:
        completion = cut(self._reply_to(request), request)
        await asyncio.sleep(self._delay_s * completion.usage.completion_tokens)
        yield completion


def from_text(reply_to: Callable[[str, str], str]) -> Callable[[CompletionRequest], str]:
    """For a reply that follows from the texts of demonstrations and query alone."""
    return lambda request: reply_to(request.prompt.prefix, request.prompt.query)
