"""Backends without an LLM: the reply is computed from the request, in milliseconds, or comes from a script.

The script is for tests, and for trying out a service without a model.
"""

import asyncio
from collections.abc import Callable, Sequence
from itertools import cycle

from app.llm.base import Completion, CompletionRequest, LanguageModelError, ModelProfile
from app.llm.streaming import Pieces, cut, spoken, whole_within_deadline, within_deadline

SCRIPTED = ModelProfile(
    name="scripted", style="chat", grammar=False, representation="absolute", description="Replies given texts in turn"
)
Reply = str | LanguageModelError


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


class ScriptedModel(ComputedModel):
    """Replies from a script.

    Args:
        script: the replies in turn, starting over at the end, or a function of the request. An error is raised.
        delay_s: before each word.
    """

    def __init__(
        self,
        script: Sequence[Reply] | Callable[[CompletionRequest], Reply],
        *,
        delay_s: float = 0.0,
        profile: ModelProfile = SCRIPTED,
    ) -> None:
        super().__init__(profile, self._next, delay_s=delay_s)
        self._script = script if callable(script) else _in_turn(script)

    def _next(self, request: CompletionRequest) -> str:
        reply = self._script(request)
        if isinstance(reply, LanguageModelError):
            raise reply
        return reply


def _in_turn(replies: Sequence[Reply]) -> Callable[[CompletionRequest], Reply]:
    turns = cycle(replies)
    return lambda _: next(turns)
