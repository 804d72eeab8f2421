"""What every backend does with a stream of pieces: one deadline, stop strings, the whole from the pieces."""

import asyncio
import re
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from dataclasses import dataclass
from typing import Literal

import anyio
from pydantic_core import from_json

from app.llm.base import (
    Completion,
    CompletionRequest,
    LanguageModel,
    ModelResponseError,
    ModelTimeoutError,
    TextDelta,
    Usage,
)

MAX_REPLY_CHARACTERS = 256 * 1024  # 25 actions take 1 kB; the rest is room for prose
Pieces = AsyncGenerator[TextDelta | Completion, None]
_WORD = re.compile(r"\S+\s*|\s+")


async def within_deadline(pieces: Pieces, timeout_s: float, model: str) -> Pieces:
    """`pieces` as they come, all of them within `timeout_s` of the first being asked for.

    Raises:
        ModelTimeoutError: at the deadline; `pieces` is closed by then.
    """
    # The deadline surrounds each wait but no `yield`: there it would interrupt the consumer instead (PEP 789). It is
    # anyio's and not asyncio's: httpx shields the closing of a connection from the former only, and where deadlines are
    # nested a second one would interrupt what the first began, and the connection would stay open for good.
    deadline = anyio.current_time() + timeout_s
    async with aclosing(pieces):
        while True:
            with anyio.CancelScope(deadline=deadline) as scope:
                piece = await anext(pieces, None)
            if scope.cancelled_caught:
                raise _late(model, timeout_s)
            if piece is None:
                return
            yield piece


async def whole_within_deadline(pieces: Pieces, timeout_s: float, model: str) -> Completion:
    """The Completion that ends a stream; of `whole(within_deadline(...))` the costly part is a deadline a piece.

    Raises:
        ModelTimeoutError: at the deadline; `pieces` is closed by then.
    """
    with anyio.move_on_after(timeout_s):
        return await whole(pieces)
    raise _late(model, timeout_s)


def _late(model: str, timeout_s: float) -> ModelTimeoutError:
    return ModelTimeoutError(f"{model} did not answer within {timeout_s:g} s")


async def in_one_piece(model: LanguageModel, request: CompletionRequest) -> Pieces:
    """The whole reply as a stream, for wrappers that do the same about a stream and about a whole reply."""
    yield await model.complete(request)


async def whole(pieces: Pieces) -> Completion:
    """The Completion that ends a stream."""
    async with aclosing(pieces):
        async for piece in pieces:
            if isinstance(piece, Completion):
                return piece
    raise ModelResponseError("the reply ended before it was complete")


@dataclass(frozen=True)
class Chunk:
    """What one event of a provider's stream tells; any of it may be missing.

    Attributes:
        finish_reason: why the reply ended: `stop` or `length`; anything else is an error.
        usage: so far; the last counts.
    """

    text: str = ""
    finish_reason: str | None = None
    usage: Usage | None = None


async def assembled(chunks: AsyncGenerator[Chunk, None], stop: Sequence[str], model: str) -> Pieces:
    """The pieces that a provider's chunks make up; the reply ends at a stop string even if the provider goes on.

    Raises:
        ModelResponseError: the reply is too long, ends early or for a reason that leaves it incomplete.
    """
    text, finish_reason, usage, size = "", "", Usage(), 0
    stops = StopStrings(stop)
    async with aclosing(chunks):
        async for chunk in chunks:
            finish_reason = chunk.finish_reason or finish_reason
            usage = chunk.usage or usage
            size += len(chunk.text)
            if size > MAX_REPLY_CHARACTERS:
                raise ModelResponseError(f"{model} replied with more than {MAX_REPLY_CHARACTERS} characters")
            if piece := stops.feed(chunk.text):
                text += piece
                yield TextDelta(piece)
    if held := stops.flush():
        text += held
        yield TextDelta(held)
    yield Completion(text, usage, _finish_reason(finish_reason, stops.stopped))


def _finish_reason(reason: str, stopped: bool) -> Literal["stop", "length"]:
    """Why the reply ended.

    Args:
        stopped: a stop string came.
    """
    if stopped or reason == "stop":
        return "stop"
    if reason == "length":
        return "length"
    if not reason:
        raise ModelResponseError("the reply ended before it was complete", retryable=True)
    raise ModelResponseError(f"the reply was ended for the reason {reason!r}")


def error_message(body: str) -> str:
    """The message in an error's body (`{"error": {"message": ...}}` or `{"error": "..."}`), else its beginning."""
    try:
        error = from_json(body)[
            "error"
        ]  # unlike json.loads it takes no half of a surrogate pair, which nobody can send on
        return str(error["message"] if isinstance(error, dict) else error)
    except (ValueError, LookupError, TypeError):
        return " ".join(body[:300].split()) or "no message"


def cut(reply: str, request: CompletionRequest) -> Completion:
    """A reply known beforehand, as far as `stop` and `max_tokens` let it come; a word counts as a token."""
    stops = StopStrings(request.prompt.stop)
    said = stops.feed(reply) + stops.flush()
    words = _WORD.findall(said)
    text = "".join(words[: request.max_tokens])
    num_prompt_tokens = len(f"{request.prompt.system} {request.prompt.user}".split())
    usage = Usage(num_prompt_tokens, 0, min(len(words), request.max_tokens))
    return Completion(text, usage, "length" if len(words) > request.max_tokens else "stop")


async def spoken(completion: Completion, delay_s: float) -> Pieces:
    """A reply known beforehand as a stream, word by word.

    Args:
        delay_s: before each word.
    """
    for word in _WORD.findall(completion.text):
        if delay_s > 0:
            await asyncio.sleep(delay_s)
        yield TextDelta(word)
    yield completion


class StopStrings:
    """Ends a text at the first stop string, for text that arrives in pieces: what might begin one is held back."""

    def __init__(self, stop: Sequence[str]) -> None:
        self._stop = [text for text in stop if text]
        self._held = ""
        self.stopped = False

    def feed(self, piece: str) -> str:
        """The text that is certain by now; nothing more once a stop string has come."""
        if self.stopped:
            return ""
        text = self._held + piece
        if found := [(at + len(stop), at) for stop in self._stop if (at := text.find(stop)) >= 0]:
            self.stopped, self._held = True, ""
            _, start = min(found)  # of the one that is complete first, as if the text came by the character
            return text[:start]
        certain = len(text) - self._num_undecided(text)
        self._held = text[certain:]
        return text[:certain]

    def flush(self) -> str:
        """What was held back, when nothing more comes."""
        held, self._held = self._held, ""
        return held

    def _num_undecided(self, text: str) -> int:
        """The length of the longest end of `text` that begins a stop string."""
        longest = max(map(len, self._stop), default=0)
        for length in range(min(longest - 1, len(text)), 0, -1):
            if any(stop.startswith(text[-length:]) for stop in self._stop):
                return length
        return 0
