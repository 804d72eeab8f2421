"""Tokens of an instruction, inflection, spelling correction, and tables of phrases to look up at a word."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rapidfuzz.distance import OSA

from app.pipeline.names import folded_characters

Phrase = tuple[str, ...]
IsWord = Callable[[str], bool]

_TOKEN = re.compile(
    r"[^\W_]+-(?:most|clockwise)\b|(?<![^\W_])[-\u2212]\d+|[^\W_]+(?:['\u2019][^\W_]+)*|[^\w\s]", re.IGNORECASE
)
_DROPPED = frozenset("\"'`\u2018\u2019\u201c\u201d\u00ab\u00bb-\u2010\u2011)")  # "left-hand" reads as "left hand"
_STOPS = {"(": ",", ":": ",", "\u2013": ",", "\u2014": ",", "!": ".", "\u2026": "."}
_CONTRACTIONS = {
    "don't": "do not", "dont": "do not", "doesn't": "does not", "mustn't": "must not", "shouldn't": "should not",
    "can't": "can not", "cannot": "can not", "won't": "will not", "isn't": "is not", "i'd": "i would",
    "i'll": "i will", "let's": "let us", "that's": "that is", "it's": "it is", "you'd": "you would",
    "you'll": "you will", "there's": "there is", "which's": "which is",
}  # fmt: skip
# Spellings of one direction
_DIRECTIONS = {
    "anticlockwise": "counterclockwise", "leftward": "left", "leftwards": "left", "rightward": "right",
    "rightwards": "right", "forwards": "forward", "backwards": "backward", "upward": "up", "upwards": "up",
    "downward": "down", "downwards": "down",
}  # fmt: skip
_GENITIVE = re.compile(r"(\w)'s$")
NUMBERS = {
    "two": "2", "three": "3", "four": "4", "five": "5", "six": "6", "seven": "7", "eight": "8", "nine": "9",
    "ten": "10", "eleven": "11", "twelve": "12",
}  # fmt: skip
# Not "one", which stands for a thing: "the blue one"
MIN_CORRECTED_CHARS = 3  # of three letters only an exchange of neighbors is corrected: "rug" is no misspelled "mug"
MIN_FREE_CHARS = 4
MIN_TWO_ERRORS_CHARS = 8


class PhraseTable:
    """A set of phrases, found by their first word."""

    def __init__(self, phrases: Iterable[Phrase]) -> None:
        self._by_first: dict[str, list[Phrase]] = {}
        for phrase in sorted(phrases, key=len, reverse=True):
            self._by_first.setdefault(phrase[0], []).append(phrase)

    def __iter__(self) -> Iterator[Phrase]:
        return (phrase for phrases in self._by_first.values() for phrase in phrases)

    def all_at(self, texts: Sequence[str], at: int) -> Iterator[Phrase]:
        """Yield the phrases of the table that begin at word `at`, the longest first."""
        if at < len(texts):
            for phrase in self._by_first.get(texts[at], ()):
                if len(phrase) == 1 or tuple(texts[at : at + len(phrase)]) == phrase:
                    yield phrase

    def end_at(self, texts: Sequence[str], at: int) -> int | None:
        """Return the end of the longest phrase that begins at word `at`; None without one."""
        phrase = next(self.all_at(texts, at), None)
        return None if phrase is None else at + len(phrase)


def phrases(text: str) -> PhraseTable:
    """Return a table of the phrases in a comma-separated text."""
    return PhraseTable(tuple(part.split()) for part in text.split(","))


class Token(NamedTuple):
    """A word or punctuation mark from character `start` to `end`, in lower case and normalized Unicode."""

    text: str
    start: int
    end: int


@dataclass(frozen=True)
class Word:
    """A token looked up in the lexicon.

    Attributes:
        text: its base form; the token's own text if it is unknown.
        known: whether the lexicon has it.
        corrected: whether its spelling was corrected.
        plural: whether the token is the plural of `text`.
    """

    token: Token
    text: str
    known: bool = True
    corrected: bool = False
    plural: bool = False


def tokens_of(text: str) -> list[Token]:
    """Return the tokens of a text, with contractions written out and without quotation marks and hyphens."""
    found: list[Token] = []
    for match in _TOKEN.finditer(text):
        said = folded_characters(match[0]) if match[0].isalnum() else match[0].lower()
        token = said.replace("\u2019", "'").replace("-most", "most").replace("-clock", "clock")
        if token not in _DROPPED:
            written_out = _CONTRACTIONS.get(token) or _STOPS.get(token) or _DIRECTIONS.get(token) or token
            found += [Token(part, *match.span()) for part in _GENITIVE.sub(r"\1 's", written_out).split()]
    return found


def plurals_of(singular: str) -> set[str]:
    """The regular plurals of a word."""
    plurals = {f"{singular}s", f"{singular}es"}
    for ending, plural in (("y", "ies"), ("f", "ves"), ("fe", "ves")):
        if singular.endswith(ending):
            plurals.add(singular.removesuffix(ending) + plural)
    return plurals


def singulars_of(plural: str) -> set[str]:
    """The words that may have it as a regular plural."""
    endings = (("s", ""), ("es", ""), ("ies", "y"), ("ves", "f"), ("ves", "fe"))
    return {plural.removesuffix(ending) + singular for ending, singular in endings if plural.endswith(ending)}


def verb_forms(verb: str) -> set[str]:
    """The regular forms of a verb's base form: pushes, pushing, pushed; placing, tapped, carries."""
    short = verb[:-1] if verb.endswith("e") else verb
    doubled = verb + verb[-1] if re.fullmatch(r".*[^aeiou][aeiou][bdgmnpt]", verb) else short
    past = f"{verb[:-1]}ied" if verb.endswith("y") else f"{doubled}ed"
    return plurals_of(verb) | {f"{short}ing", f"{doubled}ing", past, f"{short}ed"}


class Speller:
    """Finds the known word that an unknown one is a misspelling of.

    Args:
        known: what it may stand for, in groups: of words equally near, the one in the earliest group is meant.
        is_word: whether a word is one of the language: such a word is not misspelled, it means something else.
    """

    def __init__(self, known: Iterable[Iterable[str]], is_word: IsWord) -> None:
        self._rank: dict[str, int] = {}
        for rank, group in enumerate(known):
            for word in group:
                if word.isalpha() and len(word) >= MIN_CORRECTED_CHARS:
                    self._rank.setdefault(word, rank)
        self._is_word = is_word

    def correct(self, word: str) -> str | None:
        """The one known word that is nearest, if it is near enough; None for a word of the language."""
        if not word.isalpha() or len(word) < MIN_CORRECTED_CHARS or self._is_word(word):
            return None
        near = list(self._near(word))
        least = min((distance for distance, _ in near), default=None)
        best = [known for distance, known in near if distance == least]
        return best[0] if len(best) == 1 else None

    def _near(self, word: str) -> Iterator[tuple[tuple[int, int], str]]:
        for known, rank in self._rank.items():
            most = 2 if min(len(word), len(known)) >= MIN_TWO_ERRORS_CHARS else 1
            errors = OSA.distance(word, known, score_cutoff=most)
            exchanged = sorted(word) == sorted(known)
            if errors <= most and (exchanged or min(len(word), len(known)) >= MIN_FREE_CHARS):
                yield (errors, rank), known
