"""The chunks of a provider's stream -> the pieces of a reply, up to its stop string and no longer than it may be."""

from collections.abc import AsyncGenerator, Iterable, Sequence
from contextlib import aclosing
from dataclasses import dataclass
from typing import Literal

from pydantic_core import from_json

from app.llm.base import INCOMPLETE, Completion, ModelResponseError, Pieces, Reading, TextDelta, Usage
from app.pipeline.reasoning import ALL_DELIMITERS, DELIMITER, after_reasoning

MAX_REPLY_CHARACTERS = 256 * 1024  # 25 actions take 1 kB; the rest is room for prose
REMEDY = (
    "ask with a larger max_actions, which leaves more room for it, turn the model's thinking off, or let the server "
    "take the reasoning out of the reply (vLLM and SGLang: --reasoning-parser; llama.cpp: --reasoning-format)"
)


@dataclass(frozen=True)
class Chunk:
    """One event of a provider's stream; every field may be missing."""

    text: str = ""
    finish_reason: str | None = None  # why the reply ended: `stop` or `length`; anything else is an error
    usage: Usage | None = None  # so far; the last counts
    reading: Reading | None = None  # how far the prompt is read


async def assembled(
    chunks: AsyncGenerator[Chunk, None], stop: Sequence[str], model: str, *, may_reason: bool = False
) -> Pieces:
    """The pieces that a provider's chunks make up; the reply ends at a stop string even if the provider goes on.

    Of a reply that waits for its end and is cut off, only the Completion comes.

    Args:
        may_reason: as for `AnswerText`.

    Raises:
        ModelResponseError: the reply is too long, ends early, within reasoning, or for a reason that leaves it
            incomplete.
    """
    text, finish_reason, usage, size = "", "", Usage(), 0
    answer = AnswerText(stop, may_reason=may_reason)
    async with aclosing(chunks):
        async for chunk in chunks:
            finish_reason = chunk.finish_reason or finish_reason
            usage = chunk.usage or usage
            if chunk.reading:
                yield chunk.reading
            size += len(chunk.text)
            if size > MAX_REPLY_CHARACTERS:
                raise ModelResponseError(f"{model} replied with more than {MAX_REPLY_CHARACTERS} characters")
            if piece := answer.feed(chunk.text):
                text += piece
                yield TextDelta(piece)
    if not (finish_reason or answer.stopped):
        raise ModelResponseError(INCOMPLETE, retryable=True)
    rest = answer.finish()
    reason = _finish_reason(finish_reason, answer.stopped)
    if rest and not (answer.waits and reason == "length"):
        yield TextDelta(rest)
    yield Completion(text + rest, usage, reason)


def _finish_reason(reason: str, stopped: bool) -> Literal["stop", "length"]:
    """Why the reply ended; `stopped` tells that a stop string came."""
    if stopped or reason == "stop":
        return "stop"
    if reason == "length":
        return "length"
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


def _beginnings(texts: Iterable[str]) -> frozenset[str]:
    return frozenset(text[:length] for text in texts for length in range(1, len(text)))


_BEGUN_DELIMITERS = _beginnings(ALL_DELIMITERS)


class AnswerText:
    """The answer within a reply that arrives in pieces: without the model's reasoning, up to the first stop string.

    What a model considered may look like an answer, and a stop string may stand in it. So once a delimiter of reasoning
    has come, nothing is certain before the reply's end; the answer is then what follows the last end of reasoning.

    Args:
        may_reason: the reply may begin within reasoning that its chat template opened: nothing is certain before its
            end in any case.

    Attributes:
        waits: whether nothing is certain before the reply's end.
        stopped: whether a stop string has come.
    """

    def __init__(self, stop: Sequence[str], *, may_reason: bool) -> None:
        self._stop = [text for text in stop if text]
        self._begun = _beginnings(self._stop)
        self._longest = max(map(len, self._begun | _BEGUN_DELIMITERS))
        self.waits = may_reason
        self._given = self._held = ""
        self.stopped = False

    def feed(self, piece: str) -> str:
        """The text that is certain by now; nothing more once a stop string has come.

        Raises:
            ModelResponseError: if the model begins to reason after its answer has begun.
        """
        if self.stopped:
            return ""
        self._held += piece
        if self.waits:
            return ""
        ended = self._first_stop(self._held)
        delimiter = DELIMITER.search(self._held, 0, ended[1] if ended else len(self._held))
        if delimiter is None:
            return self._give(ended[0] if ended else len(self._held) - self._num_undecided(), stopped=ended is not None)
        if (self._given + self._held[: delimiter.start()]).strip():
            raise ModelResponseError(f"the reply reasons ({delimiter.group()}) after it has begun to answer; {REMEDY}")
        self.waits = True
        return ""

    def finish(self) -> str:
        """Return the rest of the answer, at the end of the reply.

        Raises:
            ModelResponseError: if the reply ends within reasoning.
        """
        if self.stopped or not self.waits:
            return self._give(len(self._held))
        self._held, begun = after_reasoning(self._held)
        if begun:
            raise ModelResponseError(f"the reply ended within its reasoning ({begun}); {REMEDY}")
        ended = self._first_stop(self._held)
        return self._give(ended[0] if ended else len(self._held), stopped=ended is not None)

    def _give(self, end: int, *, stopped: bool = False) -> str:
        text, self._held = self._held[:end], "" if stopped else self._held[end:]
        self._given += text
        self.stopped |= stopped
        return text

    def _first_stop(self, text: str) -> tuple[int, int] | None:
        """Return begin and end of the stop string that is complete first, as if the text came by the character."""
        found = [(at + len(stop), at) for stop in self._stop if (at := text.find(stop)) >= 0]
        return min(found)[::-1] if found else None

    def _num_undecided(self) -> int:
        """The length of the longest end of what is held that may begin a stop string or a delimiter of reasoning."""
        ends = ((self._held[-length:], length) for length in range(min(self._longest, len(self._held)), 0, -1))
        return next((length for end, length in ends if end in self._begun or end.lower() in _BEGUN_DELIMITERS), 0)
