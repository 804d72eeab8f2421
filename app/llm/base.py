"""The contract of a text-only LLM: requests, replies and errors."""

from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass, field
from typing import Literal, Protocol, runtime_checkable

from app.pipeline.prompt import Prompt
from roboprompt_client.errors import RoboPromptError


class LanguageModelError(RoboPromptError):
    """An LLM could not answer.

    ├── UnknownModelError      no backend of that name; lists those there are
    ├── ModelUnavailableError  weights, key or server are missing; says what to install or set
    ├── ModelBusyError         more requests than the model or its provider takes at present
    ├── ModelTimeoutError      no answer within the request's deadline
    └── ModelResponseError     the backend answered with an error or with something unintelligible

    Args:
        retryable: the same request may well succeed when it is sent again.
        retry_after_s: how long to wait before that, where it is known.
    """

    def __init__(self, message: str, *, retryable: bool = False, retry_after_s: float | None = None) -> None:
        super().__init__(message)
        self.retryable = retryable
        self.retry_after_s = retry_after_s


class UnknownModelError(LanguageModelError):
    """No backend of that name."""


class ModelUnavailableError(LanguageModelError):
    """Weights, key or server are missing."""


class ModelBusyError(LanguageModelError):
    """More requests than the model or its provider takes at present."""


class ModelTimeoutError(LanguageModelError):
    """No answer within the request's deadline."""


class ModelResponseError(LanguageModelError):
    """The backend answered with an error or with something unintelligible."""


QUICK_S = 60.0


@dataclass(frozen=True)
class ModelProfile:
    """The properties of a model that decide how a prompt for it is written."""

    name: str  # `backend/model`, e.g. ``embedded/gemma-3-270m``
    style: Literal["completion", "chat"]  # `completion` continues raw text; `chat` takes a system and a user message
    grammar: bool  # whether the backend can force the reply into a GBNF grammar
    representation: str  # the representation that suits the model best; used when a request names none
    prompt_format: str = "paper"  # the one that suits it best, used in the same way where the representation has it
    system_prompt: str = "a"  # the system prompt that suits it best (a variant's name, or `none`)
    description: str = ""  # one line for people
    timeout_s: float = QUICK_S  # the deadline that suits it best, used where a request names none
    reading_s: float = 0.0  # what that is longer for each 1,000 characters of a prompt


@dataclass(frozen=True)
class Usage:
    """Tokens of one completion; `cached_tokens` counts those prompt tokens that were not evaluated again.

    Tokens that a provider writes to its cache (Anthropic's `cache_creation_input_tokens`) were evaluated: they are
    prompt tokens like any other.
    """

    prompt_tokens: int = 0
    cached_tokens: int = 0
    completion_tokens: int = 0

    def plus(self, other: "Usage") -> "Usage":
        """Return the sum of both."""
        return Usage(
            self.prompt_tokens + other.prompt_tokens,
            self.cached_tokens + other.cached_tokens,
            self.completion_tokens + other.completion_tokens,
        )


@dataclass(frozen=True)
class CompletionRequest:
    """One question to an LLM.

    Attributes:
        max_tokens: the reply is cut there.
        timeout_s: the whole completion ends within it or raises ModelTimeoutError.
        temperature: 0 is greedy.
        cache_key: equal for requests that share the prompt's prefix; backends may route by it.
    """

    prompt: Prompt
    max_tokens: int = 1024
    timeout_s: float = 60.0
    temperature: float = 0.0
    seed: int = 0
    cache_key: str = ""


@dataclass(frozen=True)
class TextDelta:
    """A piece of the reply."""

    text: str


@dataclass(frozen=True)
class Reading:
    """How many of a prompt's tokens are read, where the backend tells before it replies."""

    tokens: int
    of: int


@dataclass(frozen=True)
class Completion:
    """The whole reply."""

    text: str
    usage: Usage = field(default_factory=Usage)
    finish_reason: Literal["stop", "length"] = "stop"


INCOMPLETE = "the reply ended before it was complete"
Pieces = AsyncGenerator[TextDelta | Reading | Completion, None]


class LanguageModel(Protocol):
    """A text-only LLM, or a wrapper around one. Safe for concurrent use from one event loop."""

    @property
    def profile(self) -> ModelProfile: ...

    def stream(self, request: CompletionRequest) -> Pieces:
        """The reply piece by piece; the last item is the Completion, whose text is the TextDeltas joined.

        A backend that cannot stream sends its reply as one piece. It keeps no deadline: `resilient.ResilientModel`,
        which is around every backend, does. A consumer that stops early closes the stream, which ends the generation.

        Raises:
            ModelUnavailableError, ModelBusyError, ModelTimeoutError, ModelResponseError.
        """
        ...

    async def aclose(self) -> None:
        """Release what the model holds; later calls are an error."""
        ...


@runtime_checkable
class StartedModel(LanguageModel, Protocol):
    """An LLM that must start before it answers, such as one that reads its weights."""

    async def warm_up(self) -> None:
        """Start it unless it runs; the first request would, too. Raises ModelUnavailableError if it cannot."""
        ...


async def complete(model: LanguageModel, request: CompletionRequest) -> Completion:
    """Return the whole reply. Raises as `stream`."""
    async with aclosing(model.stream(request)) as pieces:
        async for piece in pieces:
            if isinstance(piece, Completion):
                return piece
    raise ModelResponseError(INCOMPLETE)
