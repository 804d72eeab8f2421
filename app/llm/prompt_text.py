"""A prompt's text taken apart again into demonstrations, for the backends that are no LLM."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from app.llm.base import ModelResponseError

# observation>actions, then the separator of the paper's format (a comma before the next brace) or the end of the line
_DEMONSTRATION = re.compile(r"([^>]*>)(.*?)(?:, (?=\{|\Z)|\n)")
# a quoted name, or an integer that is no part of a word ("block2")
_TOKEN = re.compile(r"'[^']*'|(?<![\w.])[+-]?\d+(?![\w.])")
_HOLE = "\0"


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

    Steps of a closed loop and clauses that were answered already stand before it in `query`; they count as
    demonstrations.

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
