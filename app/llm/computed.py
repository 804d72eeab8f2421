"""A backend without an LLM: each reply is computed from its request, or comes from a script.

The script is for tests, and for trying out a service without a model.
"""

import asyncio
import re
from collections.abc import Callable, Sequence
from itertools import cycle

from app.llm.base import Completion, CompletionRequest, LanguageModelError, ModelProfile, Pieces, TextDelta, Usage
from app.llm.streaming import StopStrings

SCRIPTED = ModelProfile(
    name="scripted", style="chat", grammar=False, representation="absolute", description="Replies given texts in turn"
)
Reply = str | LanguageModelError
_WORD = re.compile(r"\S+\s*|\s+")


class ComputedModel:
    """Computes each reply from its request; a word of it is a piece, counts as a token, and takes `delay_s`."""

    def __init__(
        self, profile: ModelProfile, reply_to: Callable[[CompletionRequest], str], *, delay_s: float = 0.0
    ) -> None:
        self.profile = profile
        self._reply_to = reply_to
        self._delay_s = delay_s

    async def stream(self, request: CompletionRequest) -> Pieces:
        words, completion = cut(self._reply_to(request), request)
        for word in words:
            if self._delay_s > 0:
                await asyncio.sleep(self._delay_s)
            if request.piecewise:
                yield TextDelta(word)
        yield completion

    async def aclose(self) -> None:
        """Nothing is held."""


def cut(reply: str, request: CompletionRequest) -> tuple[list[str], Completion]:
    """A reply known beforehand, by the word and whole, as far as `stop` and `max_tokens` let it come."""
    stops = StopStrings(request.prompt.stop)
    said = _WORD.findall(stops.feed(reply) + stops.flush())
    words = said[: request.max_tokens]
    num_prompt_tokens = len(f"{request.prompt.system} {request.prompt.user}".split())
    usage = Usage(num_prompt_tokens, 0, len(words))
    return words, Completion("".join(words), usage, "length" if len(said) > len(words) else "stop")


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
