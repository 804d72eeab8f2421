"""The chunks of a provider's stream -> the pieces of a reply, up to its stop string and no longer than it may be."""

from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from dataclasses import dataclass
from typing import Literal

from pydantic_core import from_json

from app.llm.base import INCOMPLETE, Completion, ModelResponseError, Pieces, Reading, TextDelta, Usage

MAX_REPLY_CHARACTERS = 256 * 1024  # 25 actions take 1 kB; the rest is room for prose


@dataclass(frozen=True)
class Chunk:
    """One event of a provider's stream; every field may be missing."""

    text: str = ""
    finish_reason: str | None = None  # why the reply ended: `stop` or `length`; anything else is an error
    usage: Usage | None = None  # so far; the last counts
    reading: Reading | None = None  # how far the prompt is read


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
            if chunk.reading:
                yield chunk.reading
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
    """Why the reply ended; `stopped` tells that a stop string came."""
    if stopped or reason == "stop":
        return "stop"
    if reason == "length":
        return "length"
    if not reason:
        raise ModelResponseError(INCOMPLETE, retryable=True)
    raise ModelResponseError(f"the reply was ended for the reason {reason!r}")


def error_message(body: str) -> str:
    """The message in an error's body (`{"error": {"message": ...}}` or `{"error": "..."}`), else its beginning."""
    try:
        error = from_json(body)[
            "error"
        ]  # unlike json.loads it takes no half of a surrogate pair, which cannot be sent on
        return str(error["message"] if isinstance(error, dict) else error)
    except (ValueError, LookupError, TypeError):
        return " ".join(body[:300].split()) or "no message"


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
        """Return the text that was held back, at the end of the stream."""
        held, self._held = self._held, ""
        return held

    def _num_undecided(self, text: str) -> int:
        """The length of the longest end of `text` that begins a stop string."""
        longest = max(map(len, self._stop), default=0)
        for length in range(min(longest - 1, len(text)), 0, -1):
            if any(stop.startswith(text[-length:]) for stop in self._stop):
                return length
        return 0
