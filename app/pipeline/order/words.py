"""Tokens of a text, and the correction of spellings.

    text  = {token}
    token = letters and digits, perhaps with an apostrophe | a negative number | a punctuation mark

`Lexicon.read` looks each token up. A word that it does not know has no place in any parse.
"""

import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from rapidfuzz.distance import OSA

from app.pipeline.order import vocabulary
from app.pipeline.order.vocabulary import ADJECTIVES, Phrase

IsWord = Callable[[str], bool]
MIN_CORRECTED_CHARS = 3  # of three letters only an exchange of neighbors is corrected: "rug" is no misspelled "mug"
MIN_FREE_CHARS = 4
MIN_TWO_ERRORS_CHARS = 8
_TOKEN = re.compile(
    r"[^\W_]+-(?:most|clockwise)\b|(?<![^\W_])[-\u2212]\d+|[^\W_]+(?:['\u2019][^\W_]+)*|[^\w\s]", re.IGNORECASE
)
_GENITIVE = re.compile(r"(\w)'s$")


class Token(NamedTuple):
    """A word or punctuation mark from character `start` to `end`, in lower case and normalized Unicode."""

    text: str
    start: int
    end: int


def folded_characters(text: str) -> str:
    """The text without differences of case, width or Unicode form (NFKC)."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


def tokens_of(text: str) -> list[Token]:
    """Return the tokens of a text, with contractions written out and without quotation marks and hyphens."""
    found: list[Token] = []
    for match in _TOKEN.finditer(text):
        said = folded_characters(match[0]) if match[0].isalnum() else match[0].lower()
        token = said.replace("\u2019", "'").replace("-most", "most").replace("-clock", "clock")
        if token not in vocabulary.DROPPED:
            written_out = _GENITIVE.sub(r"\1 's", vocabulary.WRITTEN_OUT.get(token, token))
            found += [Token(part, *match.span()) for part in written_out.split()]
    return found


def phrase_of(text: str) -> Phrase:
    """Return the words of a name or an alias."""
    return tuple(token.text for token in tokens_of(text))


def noun_of(phrase: Phrase) -> str:
    """Return the last word that is no adjective: "drawer" of `drawer_top`."""
    return next((word for word in reversed(phrase) if word not in ADJECTIVES), phrase[-1])


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
