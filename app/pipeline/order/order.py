"""An instruction as a value: its clauses, what each asks for, and the objects that it names.

An instruction is read where it enters. Whatever depends on its clauses or objects takes them from its `Order`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

CLAUSE_SEPARATOR = re.compile(r"\s*,\s*(?:and\s+)?then\s+|\s+(?:and\s+)?then\s+", re.IGNORECASE)
_WORD = re.compile(r"\w+")
MAX_REMEMBERED = 1024  # readings: a robot asks with the same instruction again and again


class Mention(NamedTuple):
    """The characters from `start` to `end` of a text stand for the object `name`."""

    start: int
    end: int
    name: str


class Clause(NamedTuple):
    """One thing to do.

    Attributes:
        form: verb and roles: the words in lower case, with objects replaced by their place in the order of mention, as
            in "put the <0> on the <1>". Clauses of one form ask for the same thing of other objects.
        objects: the names that fill the roles, by place.
    """

    text: str
    form: str
    objects: tuple[str, ...]

    @property
    def verb(self) -> str:
        """The first word."""
        return self.form.partition(" ")[0]


@dataclass(frozen=True)
class Grounding:
    """What a phrase of an instruction was taken for.

    Attributes:
        by: name, alias, spelling, color, relation, taught (nothing named it, but what was taught does), or llm.
    """

    phrase: str
    object_name: str
    by: str

    def to_json(self) -> dict[str, str]:
        """As answers carry it."""
        return {"phrase": self.phrase, "object": self.object_name, "by": self.by}


@dataclass(frozen=True)
class Order:
    """An instruction as it was understood.

    Attributes:
        text: the canonical instruction: objects by their names, in the form of a taught instruction.
        names: the objects of the scene.
        phrases: what the phrases of the original wording were taken for.
        unfamiliar: why it is unlike every taught instruction, where that was allowed.
    """

    text: str
    names: tuple[str, ...]
    phrases: tuple[Grounding, ...] = ()
    unfamiliar: str | None = None

    @cached_property
    def clauses(self) -> tuple[Clause, ...]:
        """The things to do one after the other."""
        return tuple(clause_of(text, self.names) for text in clause_texts(self.text))

    @cached_property
    def form(self) -> str:
        """What is asked for, whatever the objects: see `Clause.form`."""
        return clause_of(self.text, self.names).form

    @cached_property
    def objects(self) -> tuple[str, ...]:
        """The names of the objects that it mentions, by their first mention."""
        return clause_of(self.text, self.names).objects

    def to_json(self) -> dict[str, Any]:
        """As it is stored."""
        phrases = [phrase.to_json() for phrase in self.phrases]
        return {"instruction": self.text, "phrases": phrases, "unfamiliar": self.unfamiliar}

    @classmethod
    def from_json(cls, value: Mapping[str, Any], names: Sequence[str]) -> "Order":
        """As `to_json` wrote it, about a scene with objects of these names."""
        phrases = tuple(Grounding(item["phrase"], item["object"], item["by"]) for item in value["phrases"])
        return cls(value["instruction"], tuple(names), phrases, value["unfamiliar"])


@lru_cache(MAX_REMEMBERED)
def clause_texts(instruction: str) -> tuple[str, ...]:
    """The parts that the instruction strings together with "then"."""
    return tuple(CLAUSE_SEPARATOR.split(instruction.strip()))


@lru_cache(MAX_REMEMBERED)
def clause_of(text: str, names: tuple[str, ...]) -> Clause:
    """A text as one clause. It mentions those of `names` that stand in it as phrases ('_' in a name is a space).

    A name that nowhere stands as a phrase is mentioned by its distinctive words: "open the top drawer" mentions
    `drawer_top` among `drawer_bottom` and `drawer_top`.
    """
    form = _spaced(text)
    mentions = _mentions(names, form)
    objects = tuple(dict.fromkeys(mention.name for mention in mentions))
    for start, end, name in reversed(mentions):
        form = f"{form[:start]}<{objects.index(name)}>{form[end:]}"
    return Clause(text, form, objects)


def mentions_in(text: str, names: Sequence[str]) -> tuple[Mention, ...]:
    """Every mention, from left to right, by its place in the text, which has no space around it.

    None where lower case takes more characters than upper case, as with some letters of Turkish.
    """
    return tuple(_mentions(names, _spaced(text))) if len(text.lower()) == len(text) else ()


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
        others = {word for other in names if other != name for word in _words(other)}
        by_word = [_occurrences(word, text, name) for word in _words(name) - others]
        if all(by_word):
            found += [mention for mentions in by_word for mention in mentions]
    return sorted(found)


def _occurrences(phrase: str, text: str, name: str) -> list[Mention]:
    return [Mention(*match.span(), name) for match in re.finditer(rf"\b{re.escape(phrase)}\b", text)]


def _words(name: str) -> set[str]:
    return set(_WORD.findall(_spaced(name)))


def _spaced(text: str) -> str:
    return text.lower().replace("_", " ").strip().rstrip(".")
