"""Backends without an LLM: the reply is computed from the prompt's text, in milliseconds."""

from collections.abc import Callable

from app.llm.base import Completion, CompletionRequest, ModelProfile
from app.llm.streaming import Pieces, spoken, whole, within_deadline


class ComputedModel:
    """Computes each reply anew.

    Args:
        reply_to: demonstrations and query -> reply; may raise ModelResponseError.
    """

    def __init__(self, profile: ModelProfile, reply_to: Callable[[str, str], str]) -> None:
        self._profile = profile
        self._reply_to = reply_to

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
        reply = self._reply_to(request.prompt.prefix, request.prompt.query)
        async for piece in spoken(reply, request):
            yield piece
