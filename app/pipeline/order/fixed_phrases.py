"""What a clause says besides its verb and its objects: "to the left", "in the top drawer", "the dirt", "away".

A taught phrase counts as a whole and with its own preposition: "from 5 to 2" has the words of "from 2 to 5". One that
says which way, how often or in which manner may not be left out, since its opposite is another motion; a place may, as
long as no other was taught.
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from app.pipeline.order.vocabulary import ADJECTIVES
from app.pipeline.order.words import NUMBERS

# Words without which a clause asks for something else, as numbers are: "in the reverse order"
_ALTERING = frozenset({
    "reverse", "reversed", "backward", "backwards", "inverse", "inverted", "opposite", "contrary", "alternate",
    "alternating", "ascending", "descending", "first", "last", "half", "halfway", "partly", "partially", "almost",
    "nearly", "slightly", "only", "except", "without", "once", "twice", "thrice", "never",
})  # fmt: skip
_DIRECTIONS = frozenset({
    "up", "down", "upward", "upwards", "downward", "downwards", "forward", "forwards", "clockwise", "counterclockwise",
    "anticlockwise", "counter", "sideways", "upside", "inside", "outside", "leftward", "leftwards", "rightward",
    "rightwards", "north", "south", "east", "west", "open", "closed", "shut", "on", "off", "in", "out",
})  # fmt: skip
_DECIDING = _ALTERING | _DIRECTIONS | ADJECTIVES | set(NUMBERS.values())
_PLACES = frozenset({"on", "in", "at", "of", "under", "above", "next to", "behind", "in front of", "by", "against"})
# Marks among a clause's fixed words: an object stands here, after its article or right after the word before.
OBJECT, MODIFIED_OBJECT = "", "+"


class FixedPhrase(NamedTuple):
    """Words that belong together.

    Attributes:
        role: of the preposition before them (see `vocabulary.PREPOSITIONS`); empty without one.
        describes: whether they stand right before an object, as "red" in "the red button" where nothing is named so.
    """

    role: str
    words: tuple[str, ...]
    describes: bool = False

    @property
    def decides(self) -> bool:
        """Whether a clause without them asks for something else."""
        deciding = _DECIDING if self.role not in _PLACES else _ALTERING
        decides = any(word in deciding or word.isdigit() for word in self.words)
        return decides and not (self.describes and ADJECTIVES.issuperset(self.words))


def fixed_phrases(fixed: Sequence[str]) -> tuple[FixedPhrase, ...]:
    """The phrases among a clause's fixed words, in which "to:" stands for a preposition; in any order the same."""
    found: list[FixedPhrase] = []
    role, words = "", tuple[str, ...]()

    def close(*, describes: bool = False) -> None:
        if words:
            found.append(FixedPhrase(role, words, describes and not role))

    for word in fixed:
        if word in (OBJECT, MODIFIED_OBJECT) or word.endswith(":"):
            close(describes=word == MODIFIED_OBJECT)
            role, words = word.removesuffix(":") if word.endswith(":") else "", ()
        else:
            words = (*words, word)
    close()
    return tuple(sorted(found))


def fits(asked: Sequence[FixedPhrase], taught: Sequence[FixedPhrase]) -> bool:
    """Whether a clause that asks with some phrases asks for what was taught with others."""
    remaining = Counter((phrase.role, phrase.words) for phrase in taught)
    loose = {word for phrase in taught if not phrase.role for word in phrase.words}
    for phrase in asked:
        whole = next((key for key in _keys(phrase) if remaining[key]), None)
        if whole is not None:
            remaining[whole] -= 1
        elif phrase.role or phrase.decides or not loose.issuperset(phrase.words):
            return False
    return not any(remaining[phrase.role, phrase.words] for phrase in taught if phrase.decides)


def _keys(phrase: FixedPhrase) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """As what a phrase may have been taught: "left" also as "to the left"."""
    own = (phrase.role, phrase.words)
    return (own,) if phrase.role or phrase.describes else (own, ("to", phrase.words))
