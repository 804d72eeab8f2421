"""A backend that gives the replies of a script: for tests, and for trying out a service without a model."""

from collections.abc import Callable, Sequence
from itertools import cycle

from app.llm.base import CompletionRequest, LanguageModelError, ModelProfile
from app.llm.computed import ComputedModel

PROFILE = ModelProfile(
    name="scripted", style="chat", grammar=False, representation="absolute", description="Replies given texts in turn"
)
Reply = str | LanguageModelError


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
        profile: ModelProfile = PROFILE,
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
