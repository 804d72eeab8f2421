"""A backend that replies what it was told to reply: for tests, and for trying out a service without a model."""

from collections.abc import Callable, Sequence
from itertools import cycle

from app.llm.base import Completion, CompletionRequest, LanguageModelError, ModelProfile
from app.llm.streaming import Pieces, spoken, whole, within_deadline

PROFILE = ModelProfile(
    name="scripted", style="chat", grammar=False, representation="absolute", description="Replies given texts in turn"
)
Reply = str | LanguageModelError


class ScriptedModel:
    """Replies from a script.

    Args:
        script: the replies in turn, starting over at the end, or a function of the request. An error is raised.
        delay_s: before each word.

    Attributes:
        requests: what it was asked, in order.
    """

    def __init__(
        self,
        script: Sequence[Reply] | Callable[[CompletionRequest], Reply],
        *,
        delay_s: float = 0.0,
        profile: ModelProfile = PROFILE,
    ) -> None:
        self._profile = profile
        self._delay_s = delay_s
        self._reply = script if callable(script) else _in_turn(script)
        self.requests: list[CompletionRequest] = []

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
        self.requests.append(request)
        reply = self._reply(request)
        if isinstance(reply, LanguageModelError):
            raise reply
        async for piece in spoken(reply, request, self._delay_s):
            yield piece


def _in_turn(replies: Sequence[Reply]) -> Callable[[CompletionRequest], Reply]:
    turns = cycle(replies)
    return lambda _: next(turns)
