"""An instruction as a value: its clauses, the form of each, and the objects that it mentions.

An instruction is parsed once, where it enters the service. All further code takes clauses and objects from its `Order`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

from app.pipeline.order.forms import BASE_VERBS
from app.pipeline.order.vocabulary import DETERMINERS, QUANTIFIERS, SHORT_PREPOSITIONS
from app.pipeline.order.words import folded_characters, stands_alone, words_of

FIELD = "instruction"  # of requests and uploads
CLAUSE_SEPARATOR = re.compile(r"\s*,\s*(?:and\s+)?then\s+|\s+(?:and\s+)?then\s+", re.IGNORECASE)
_PARTS = re.compile(r"\s*(?:,\s*(?:and\s+)?|\band\s+)")
_WORD = re.compile(r"\w+")
_PASSIVE = re.compile(r"(?<!\bthat )(?<!\bwhich )\b(?:is|are|was|were|be|being|been|gets?) (\w+)")
# "In place" and "both hands" have no verb, "to place" has one
BEFORE_NOUNS = (DETERMINERS | QUANTIFIERS | SHORT_PREPOSITIONS | {"its"}) - {"to"}
MAX_REMEMBERED = 1024  # parsed texts: robots repeat their instructions


class Mention(NamedTuple):
    """The characters from `start` to `end` of a text name the object `name`."""

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
        """Its first verb: see `verb_of`."""
        return verb_of(self.form)

    @property
    def parts(self) -> tuple[str, ...]:
        """The parts of its form that "and" or a comma separates."""
        return tuple(_PARTS.split(self.form))


@dataclass(frozen=True)
class Grounding:
    """The object that a phrase of an instruction names.

    Attributes:
        by: name, alias, color, relation, or taught (named by the taught instruction only).
    """

    phrase: str
    object_name: str
    by: str

    def to_json(self) -> dict[str, str]:
        """Return it as answers have it."""
        return {"phrase": self.phrase, "object": self.object_name, "by": self.by}


@dataclass(frozen=True)
class Order:
    """An instruction as it was understood.

    Attributes:
        text: the canonical instruction: objects by their names, in the form of a taught instruction.
        names: the objects of the scene.
        phrases: the objects that phrases of the original wording name.
        unfamiliar: why it is unlike every taught instruction; None unless the request allowed that.
    """

    text: str
    names: tuple[str, ...]
    phrases: tuple[Grounding, ...] = ()
    unfamiliar: str | None = None

    @cached_property
    def clauses(self) -> tuple[Clause, ...]:
        """The things to do one after the other."""
        return tuple(_clause_of(text, self.names) for text in _clause_texts(self.text))

    @cached_property
    def form(self) -> str:
        """The form of the whole text, independent of the objects: see `Clause.form`."""
        return _clause_of(self.text, self.names).form

    @cached_property
    def verbs(self) -> tuple[str, ...]:
        """The verbs of its clauses, and of their parts."""
        return tuple(verb_of(part) for clause in self.clauses for part in clause.parts)

    @cached_property
    def objects(self) -> tuple[str, ...]:
        """The names of the objects that it mentions, by their first mention."""
        return _clause_of(self.text, self.names).objects

    @cached_property
    def mentions(self) -> tuple[Mention, ...]:
        """Every mention of an object, from left to right.

        Empty where a letter has another number of characters in lower case, as "\u00df" has.
        """
        folded = _folded(self.text)
        is_aligned = len(folded) == len(self.text) and all(map(str.__eq__, folded, map(_folded, self.text)))
        return _mentions(self.names, folded) if is_aligned else ()

    def placeholder(self, name: str) -> str:
        """Return what stands for the object in `form`, as `<0>`; its name if it is not mentioned."""
        return f"<{self.objects.index(name)}>" if name in self.objects else name

    def to_json(self) -> dict[str, Any]:
        """Return the order as it is stored."""
        phrases = [phrase.to_json() for phrase in self.phrases]
        return {"instruction": self.text, "phrases": phrases, "unfamiliar": self.unfamiliar}

    @classmethod
    def from_json(cls, value: Mapping[str, Any], names: Sequence[str]) -> "Order":
        """Return the inverse of `to_json`, for a scene with objects of these names."""
        phrases = tuple(Grounding(item["phrase"], item["object"], item["by"]) for item in value["phrases"])
        return cls(value["instruction"], tuple(names), phrases, value["unfamiliar"])


@lru_cache(MAX_REMEMBERED)
def _clause_texts(instruction: str) -> tuple[str, ...]:
    """Return the parts of an instruction that "then" separates."""
    return tuple(CLAUSE_SEPARATOR.split(instruction.strip()))


@lru_cache(MAX_REMEMBERED)
def _clause_of(text: str, names: tuple[str, ...]) -> Clause:
    """Return a text as one clause. It mentions the objects whose names it contains ('_' in a name is a space).

    A name that it does not contain is mentioned by its distinctive words: "open the top drawer" mentions
    `drawer_top` among `drawer_bottom` and `drawer_top`.
    """
    form = _spaced(text)
    mentions = _mentions(names, form)
    objects = tuple(dict.fromkeys(mention.name for mention in mentions))
    for start, end, name in reversed(mentions):
        form = f"{form[:start]}<{objects.index(name)}>{form[end:]}"
    return Clause(text, form, objects)


@lru_cache(MAX_REMEMBERED)
def verb_of(form: str) -> str:
    """Return the base form of the first verb, as "put" in "please put the <0> on ..." and "the <0> is put on ...".

    The first word where there is none before the first object, nor a passive after it.
    """
    first, _, rest = form.partition("<")
    words = _WORD.findall(first)
    known = (BASE_VERBS.get(word) for before, word in pairwise(("", *words)) if before not in BEFORE_NOUNS)
    passive = (BASE_VERBS.get(found[1]) for found in _PASSIVE.finditer(rest))
    return next(filter(None, (*known, *passive)), words[0] if words else "")


@lru_cache(MAX_REMEMBERED)
def template_of(text: str, names: tuple[str, ...]) -> str:
    """Return the text in lower case, with whole names of objects replaced by their place in the order of mention.

    The places stand between characters that no instruction has.
    """
    template = _spaced(text)
    mentions = _whole_names(names, template)
    objects = list(dict.fromkeys(mention.name for mention in mentions))
    for start, end, name in reversed(mentions):
        template = f"{template[:start]}\0{objects.index(name)}\0{template[end:]}"
    return template


def _mentions(names: Sequence[str], text: str) -> tuple[Mention, ...]:
    found = _whole_names(names, text)
    for start, end, _ in found:
        text = text[:start] + "\0" * (end - start) + text[end:]
    for name in set(names) - {mention.name for mention in found}:
        others = {word for other in names if other != name for word in _words(other)}
        by_word = [_occurrences(word, text, name) for word in _words(name) - others]
        if all(by_word):
            found += [mention for mentions in by_word for mention in mentions]
    return tuple(sorted(found))


def _whole_names(names: Sequence[str], text: str) -> list[Mention]:
    """Return every whole name in `text`, from left to right; the longest counts: no "cup" in "cup holder"."""
    found: list[Mention] = []
    for name in sorted(names, key=len, reverse=True):
        phrases = _occurrences(_spaced(name), text, name)
        found += phrases
        for start, end, _ in phrases:
            text = text[:start] + "\0" * (end - start) + text[end:]
    return sorted(found)


def _occurrences(phrase: str, text: str, name: str) -> list[Mention]:
    found: list[Mention] = []
    start = text.find(phrase)
    while start >= 0:
        end = start + len(phrase)
        if stands_alone(text, start, end):
            found.append(Mention(start, end, name))
            start = end - 1
        start = text.find(phrase, start + 1)
    return found


def _words(name: str) -> set[str]:
    return set(words_of(_spaced(name)))


def _folded(text: str) -> str:
    return folded_characters(text).replace("_", " ")


def _spaced(text: str) -> str:
    return " ".join(_folded(text).split()).rstrip(".")
