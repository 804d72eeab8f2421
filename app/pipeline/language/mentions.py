"""What an instruction says about the objects: which it names, in which order, and the clauses it consists of."""

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

CLAUSE_SEPARATOR = re.compile(r"\s*,\s*(?:and\s+)?then\s+|\s+(?:and\s+)?then\s+", re.IGNORECASE)
_WORD = re.compile(r"\w+")
REMEMBERED = 1024  # results that are kept


class Mention(NamedTuple):
    """The characters from `start` to `end` of a text stand for the object `name`."""

    start: int
    end: int
    name: str


def mention_order(names: Sequence[str], instruction: str) -> tuple[str, ...]:
    """Those of `names` that the instruction mentions, by their first mention ('_' in a name counts as a space).

    A name is mentioned where it stands as a phrase; one that nowhere does, by its distinctive words: "open the top
    drawer" mentions `drawer_top` among `drawer_bottom` and `drawer_top`.
    """
    return _mention_order(tuple(names), instruction)


@lru_cache(maxsize=REMEMBERED)  # a robot asks with the same instruction again and again
def _mention_order(names: tuple[str, ...], instruction: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(mention.name for mention in _mentions(names, _spaced(instruction))))


def template(names: Sequence[str], instruction: str) -> str:
    """The instruction with the objects it mentions replaced by their place in the order of mention.

    "push the red button" and "push the blue button" share the template "push the <0>": they ask for the same thing of
    another object. Of a name that is mentioned by its distinctive words, these are replaced.
    """
    text = _spaced(instruction)
    mentions = _mentions(names, text)
    place = {name: k for k, name in enumerate(dict.fromkeys(mention.name for mention in mentions))}
    for start, end, name in reversed(mentions):
        text = f"{text[:start]}<{place[name]}>{text[end:]}"
    return text


def mentions(names: Sequence[str], instruction: str) -> tuple[Mention, ...]:
    """Every mention, from left to right, by its place in the instruction, which has no space around it.

    None where lower case takes more characters than upper case, as with some letters of Turkish.
    """
    return tuple(_mentions(names, _spaced(instruction))) if len(instruction.lower()) == len(instruction) else ()


@lru_cache(maxsize=REMEMBERED)
def clauses(instruction: str) -> tuple[str, ...]:
    """The parts that the instruction strings together with "then"."""
    return tuple(CLAUSE_SEPARATOR.split(instruction.strip()))


def _mentions(names: Sequence[str], text: str) -> list[Mention]:
    """Every mention in `text`, from left to right; no two overlap."""
    found: list[Mention] = []
    for name in sorted(names, key=len, reverse=True):
        phrases = _occurrences(_spaced(name), text, name)
        found += phrases
        # a name inside a longer name ("cup" in "cup holder") must not count as mentioned
        for start, end, _ in phrases:
            text = text[:start] + "\0" * (end - start) + text[end:]
    for name in set(names) - {mention.name for mention in found}:
        by_word = [_occurrences(word, text, name) for word in _distinctive_words(name, names)]
        if all(by_word):
            found += [mention for mentions in by_word for mention in mentions]
    return sorted(found)


def _occurrences(phrase: str, text: str, name: str) -> list[Mention]:
    return [Mention(*match.span(), name) for match in re.finditer(rf"\b{re.escape(phrase)}\b", text)]


def _distinctive_words(name: str, names: Sequence[str]) -> set[str]:
    """The words of `name` that no other of `names` has."""
    others = {word for other in names if other != name for word in _words(other)}
    return _words(name) - others


def _words(name: str) -> set[str]:
    return set(_WORD.findall(_spaced(name)))


def _spaced(text: str) -> str:
    return text.lower().replace("_", " ").strip().rstrip(".")
