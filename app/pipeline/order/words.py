"""Words and other tokens of a text, in any script.

    text  = {token}
    token = letters and digits, perhaps with an apostrophe | a negative number | a punctuation mark

`Lexicon.read` looks each token up. A word that it does not know has no place in any parse.
"""

import re
import unicodedata
from typing import NamedTuple

from app.pipeline.order import vocabulary
from app.pipeline.order.vocabulary import ADJECTIVES, Phrase

_TOKEN = re.compile(
    r"[^\W_]+-(?:most|clockwise)\b|(?<![^\W_])[-\u2212]\d+|[^\W_]+(?:['\u2019][^\W_]+)*|[^\w\s]", re.IGNORECASE
)
_GENITIVE = re.compile(r"(\w)'s$")
_JOINERS = "\u200c\u200d"  # between letters of Arabic and Indic scripts
# Scripts whose words no space separates, or to whose nouns particles are joined (Hangul). Katakana is none of them:
# among the other Japanese scripts it shows where a word ends.
_WITHOUT_SPACES = re.compile(
    "[\u0e00-\u0eff\u0f00-\u109f\u1100-\u11ff\u1780-\u17ff\u3005-\u309f\u3400-\u9fff\uac00-\ud7ff\uf900-\ufaff"
    "\U00020000-\U0003ffff]"
)


class Token(NamedTuple):
    """A word or punctuation mark from character `start` to `end`, in lower case and normalized Unicode."""

    text: str
    start: int
    end: int


def folded_characters(text: str) -> str:
    """The text without differences of case, width or Unicode form (NFKC)."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


def normalized(text: str) -> str:
    """The text in Unicode form NFKC, with single spaces."""
    return " ".join(unicodedata.normalize("NFKC", text).split())


def is_question(text: str) -> bool:
    """Whether the text has a question mark, of whatever script."""
    names = (unicodedata.name(character, "") for character in text if not character.isalnum())
    return any("QUESTION" in name or "INTERROBANG" in name for name in names)


def stands_alone(text: str, start: int, end: int) -> bool:
    """Whether no letter, mark or digit that belongs to a word with the characters `start` to `end` adjoins them."""
    before, after = text[start - 1 : start], text[end : end + 1]
    return not (_are_joined(before, text[start]) or _are_joined(text[end - 1], after))


def _are_joined(one: str, other: str) -> bool:
    if not (one and other and _is_of_word(one) and _is_of_word(other)):
        return False
    is_letter = unicodedata.category(other)[0] != "M" and other not in _JOINERS
    return not (is_letter and _WITHOUT_SPACES.search(one + other))


def _is_of_word(character: str) -> bool:
    return character in _JOINERS or unicodedata.category(character)[0] in "LMN"


def words_of(text: str) -> list[str]:
    """Return the letters, marks and digits that stand together."""
    return "".join(character if _is_of_word(character) else " " for character in text).split()


def tokens_of(text: str) -> list[Token]:
    """Return the tokens of a text, with contractions written out and without quotation marks and hyphens."""
    found: list[Token] = []
    # the marks of a script belong to its words, which `re` does not know
    letters = "".join("x" if _is_of_word(character) and not character.isalnum() else character for character in text)
    for match in _TOKEN.finditer(letters):
        shown = text[slice(*match.span())]
        said = folded_characters(shown) if match[0][0].isalnum() else shown
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
