"""Models without an LLM, which compute each reply from its request or take it from a script.

The script is for tests and for trying out a service. Two baselines read a prompt's text as an LLM does:

`nearest` repeats, word for word, the actions of the demonstration whose observation is nearest. It shows what an LLM
adds to a representation: rows of `object_frame` are right for another scene if they are relative to the right objects.

`regression` is a ridge regression of the actions' integers on the observation's integers, without objects, frames or
rotations. It shows how much of a task is a linear map. It can neither follow an instruction that no demonstration
carries out, nor choose the number of actions.
"""

import asyncio
import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import cycle

import numpy as np
import numpy.typing as npt

from app.llm.base import (
    Completion,
    CompletionRequest,
    LanguageModelError,
    ModelProfile,
    ModelResponseError,
    Pieces,
    TextDelta,
    Usage,
)
from app.llm.streaming import AnswerText

SCRIPTED = ModelProfile(
    name="scripted", style="chat", grammar=False, representation="absolute", description="Replies given texts in turn"
)
Reply = str | LanguageModelError
_WORD = re.compile(r"\S+\s*|\s+")

# observation>actions, then the separator of the paper's format (a comma before the next brace) or the end of the line
_DEMONSTRATION = re.compile(r"([^>]*>)(.*?)(?:, (?=\{|\Z)|\n)")
# a quoted name, or an integer that is no part of a word ("block2")
_TOKEN = re.compile(r"'[^']*'|(?<![\w.])[+-]?\d+(?![\w.])")
_HOLE = "\0"
NEAREST = ModelProfile(
    name="nearest",
    style="completion",
    grammar=False,
    representation="object_frame",
    system_prompt="none",
    description="No LLM: copies the actions of the nearest demonstration, a yardstick",
)
REGRESSION = replace(
    NEAREST,
    name="regression",
    representation="absolute",
    description="No LLM: ridge regression on the prompt's integers, a yardstick",
)
YARDSTICKS = frozenset({NEAREST.name, REGRESSION.name})
MIN_DEMONSTRATIONS = 2
# Weight of the squared coefficients against squared errors in bins. Positions vary over tens of bins, so it decides
# only where the demonstrations leave a coefficient open.
RIDGE = 1.0

Numbers = npt.NDArray[np.float64]


class ComputedModel:
    """Computes each reply from its request; a word of it is a piece, counts as a token, and takes `delay_s`."""

    def __init__(
        self, profile: ModelProfile, reply_to: Callable[[CompletionRequest], str], *, delay_s: float = 0.0
    ) -> None:
        self.profile = profile
        self._reply_to = reply_to
        self._delay_s = delay_s

    async def stream(self, request: CompletionRequest) -> Pieces:
        words, completion = _cut(self._reply_to(request), request)
        for word in words:
            if self._delay_s > 0:
                await asyncio.sleep(self._delay_s)
            yield TextDelta(word)
        yield completion

    async def aclose(self) -> None:
        """Nothing is held."""


def _cut(reply: str, request: CompletionRequest) -> tuple[list[str], Completion]:
    """Return a reply's words and the reply as a whole, up to a stop string and to `max_tokens`."""
    answer = AnswerText(request.prompt.stop, may_reason=True)
    said = _WORD.findall(answer.feed(reply) + answer.finish())
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
        turns = cycle(() if callable(script) else script)
        self._script = script if callable(script) else lambda _: next(turns)

    def _next(self, request: CompletionRequest) -> str:
        reply = self._script(request)
        if isinstance(reply, LanguageModelError):
            raise reply
        return reply


def nearest() -> ComputedModel:
    """The model `nearest`."""
    return ComputedModel(NEAREST, lambda request: copied_reply(request.prompt.prefix, request.prompt.query))


def regression() -> ComputedModel:
    """The model `regression`."""
    return ComputedModel(REGRESSION, lambda request: regressed_reply(request.prompt.prefix, request.prompt.query))


@dataclass(frozen=True)
class Pattern:
    """A text taken apart: `template` with a hole for each integer, and the integers as they were written."""

    template: str
    integers: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> "Pattern":
        """Take the text apart."""
        integers: list[str] = []

        def hole(match: re.Match[str]) -> str:
            if match.group().startswith("'"):
                return match.group()
            integers.append(match.group())
            return _HOLE

        template = _TOKEN.sub(hole, text)
        return cls(template, tuple(integers))

    def filled(self, integers: Sequence[str]) -> str:
        """The template with other integers."""
        literals = self.template.split(_HOLE)
        return literals[0] + "".join(a + b for a, b in zip(integers, literals[1:], strict=True))


Pair = tuple[Pattern, Pattern]  # observation, actions


def taken_apart(prefix: str, query: str) -> tuple[list[Pair], Pattern]:
    """The demonstrations of a prompt, and the observation to find actions for.

    Clauses that were answered already stand before it in `query` and count as demonstrations.

    Raises:
        ModelResponseError: if the text is not a row of demonstrations.
    """
    text = prefix + query
    pairs, end = [], 0
    for match in _DEMONSTRATION.finditer(text):
        if match.start() != end:
            break
        pairs.append((Pattern.parse(match[1]), Pattern.parse(match[2])))
        end = match.end()
    if end < len(prefix) or ">" in text[end:-1]:
        raise ModelResponseError("the prompt cannot be taken apart into demonstrations 'observation>actions'")
    return pairs, Pattern.parse(text[end:])


def alike(pairs: Sequence[Pair], observation: Pattern, at_least: int) -> list[Pair]:
    """The demonstrations whose observation differs from the query's in numbers only; failing that, all of like size."""
    same = [pair for pair in pairs if pair[0].template == observation.template]
    if len(same) < at_least:
        same = [pair for pair in pairs if len(pair[0].integers) == len(observation.integers)]
    return same


def copied_reply(prefix: str, query: str) -> str:
    """The actions of the demonstration whose integers are nearest to those of `query`; of equals the last.

    Raises:
        ModelResponseError: as `taken_apart`, or if none is like the query.
    """
    shown, observation = taken_apart(prefix, query)
    place = np.array(observation.integers, dtype=np.float64)
    pairs = alike(shown, observation, at_least=1)
    if not pairs:
        raise ModelResponseError("nearest found no demonstration with as many numbers as the query")

    def distance(pair: Pair) -> float:
        return float(np.linalg.norm(np.array(pair[0].integers, dtype=np.float64) - place))

    _, actions = min(reversed(pairs), key=distance)
    return actions.filled(actions.integers)


def regressed_reply(prefix: str, query: str) -> str:
    """The actions for `query`, in the form of the demonstrations.

    Raises:
        ModelResponseError: as `taken_apart`, or if too few are like the query.
    """
    shown, observation = taken_apart(prefix, query)
    pairs = _of_one_form(shown, observation)
    inputs = np.array([seen.integers for seen, _ in pairs], dtype=np.float64)
    written = [actions.integers for _, actions in pairs]
    outputs = np.array(written, dtype=np.float64)
    predicted = _ridge(inputs, outputs, np.array(observation.integers, dtype=np.float64))
    columns = list(zip(*written, strict=True))
    signs = {integer[0] for column in columns for integer in column} & {"+", "-"}
    return pairs[-1][1].filled([_as_written(*item, signs) for item in zip(predicted, columns, strict=True)])


def _of_one_form(pairs: Sequence[Pair], observation: Pattern) -> list[Pair]:
    """The demonstrations that are like the query, and of these the ones whose actions have the most frequent form."""
    same = alike(pairs, observation, MIN_DEMONSTRATIONS)
    forms = Counter(actions.template for _, actions in same)
    chosen = [pair for pair in same if pair[1].template == forms.most_common(1)[0][0]]
    if len(chosen) < MIN_DEMONSTRATIONS:
        raise ModelResponseError(
            f"regression found {len(chosen)} of {len(pairs)} demonstrations that are like the query; it needs"
            f" {MIN_DEMONSTRATIONS}"
        )
    return chosen


def _ridge(inputs: Numbers, outputs: Numbers, query: Numbers) -> Numbers:
    """The outputs (K,) at `query` (D,), from inputs (N, D) and outputs (N, K)."""
    input_mean, output_mean = inputs.mean(axis=0), outputs.mean(axis=0)
    centered = inputs - input_mean
    gram = centered.T @ centered + RIDGE * np.eye(len(query))
    coefficients = np.linalg.solve(gram, centered.T @ (outputs - output_mean))
    predicted: Numbers = output_mean + (query - input_mean) @ coefficients
    return predicted


def _as_written(value: float, column: Sequence[str], signs: Collection[str]) -> str:
    """`value` as an integer, one of two choices (a gripper) or any, with those signs that the demonstrations use."""
    choices = sorted({int(written) for written in column})
    integer = min(choices, key=lambda choice: abs(choice - value)) if len(choices) <= 2 else round(value)
    if "+" in signs and column[0][0] in "+-":
        return f"{integer:+d}"
    return str(integer if "-" in signs else max(integer, 0))
