"""Backends without an LLM: the reply is computed from the request, in milliseconds."""

from collections.abc import Callable

from app.llm.base import Completion, CompletionRequest, ModelProfile
from app.llm.streaming import Pieces, spoken, whole, within_deadline


class ComputedModel:
    """Computes each reply anew.

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
        return await whole(self.stream(request))

    async def aclose(self) -> None:
        """Nothing is held."""

    async def _pieces(self, request: CompletionRequest) -> Pieces:
        async for piece in spoken(self._reply_to(request), request, self._delay_s):
            yield piece


def from_text(reply_to: Callable[[str, str], str]) -> Callable[[CompletionRequest], str]:
    """For a reply that follows from the texts of demonstrations and query alone."""
    return lambda request: reply_to(request.prompt.prefix, request.prompt.query)
