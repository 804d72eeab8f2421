"""A clause as it was read: its verb, the objects in their roles, and what it says besides.

The last are fixed phrases: "to the left", "in the top drawer", "the dirt", "away". A taught one counts as a whole and
with its own preposition: "from 5 to 2" has the words of "from 2 to 5". One that says which way, how often or in which
manner may not be left out, since its opposite is another motion; a place may, as long as no other was taught.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from app.pipeline.order.noun_phrases import NounPhrase
from app.pipeline.order.verbs import DESTINATIONS, FAMILIES, Family
from app.pipeline.order.vocabulary import ADJECTIVES
from app.pipeline.order.words import NUMBERS

DIRECT = ""  # the role of a direct object; the others are named after prepositions
INSTRUMENT = "with"  # the role that may be left out
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


Signature = tuple[str | None, tuple[tuple[str, int], ...], tuple[FixedPhrase, ...]]


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


def without(group: Sequence[NounPhrase], excepted: Sequence[NounPhrase]) -> tuple[NounPhrase, ...]:
    """The objects of "all mugs" without the excepted ones; none where these are not some of the group."""
    names = {phrase.name for phrase in excepted}
    left = tuple(phrase for phrase in group if phrase.name not in names)
    is_group = len(group) > 1 and len({(phrase.start, phrase.end) for phrase in group}) == 1
    return left if is_group and names and len(left) == len(group) - len(names) else ()


@dataclass(frozen=True)
class ParsedClause:
    """One thing to do.

    Attributes:
        verb: in its base form, with its particle; None where a noun phrase stands alone.
        roles: by preposition (see `vocabulary.PREPOSITIONS`) or `DIRECT` the objects, in their order.
        fixed: what of taught instructions is no object, as "the dirt" in "sweep the dirt to the dustpan".
        goes_on: whether a further word belongs to the last of `fixed`: no object stands between.
    """

    verb: str | None
    roles: tuple[tuple[str, tuple[NounPhrase, ...]], ...] = ()
    fixed: tuple[FixedPhrase, ...] = ()
    goes_on: bool = False

    def objects_in(self, role: str) -> tuple[NounPhrase, ...]:
        """Those of a role; none if it is not filled."""
        return dict(self.roles).get(role, ())

    def families_with(self, verb: str | None) -> list[Family]:
        """The families in which its verb and another are alike."""
        roles = {role for role, _ in self.roles if role != DIRECT}
        return [family for family in FAMILIES if {verb, self.verb} <= family.verbs and family.holds(roles)]

    @property
    def takes_somewhere(self) -> bool:
        """Whether it says where something is taken to, or off."""
        return any(role in DESTINATIONS or role == "off" for role, _ in self.roles)

    @property
    def phrases(self) -> tuple[NounPhrase, ...]:
        """All of its objects."""
        return tuple(phrase for _, phrases in self.roles for phrase in phrases)

    @property
    def signature(self) -> Signature:
        """What it asks for, whatever the objects."""
        return self.verb, tuple(sorted((role, len(phrases)) for role, phrases in self.roles)), self.fixed_phrases

    @cached_property
    def fixed_phrases(self) -> tuple[FixedPhrase, ...]:
        """What it says besides; in any order the same."""
        return tuple(sorted(self.fixed))

    def with_fixed(self, role: str, word: str) -> "ParsedClause":
        """With a word that is no object, after a preposition or without one."""
        *others, last = self.fixed if self.goes_on and not role else (*self.fixed, FixedPhrase(role, ()))
        return replace(self, fixed=(*others, last._replace(words=(*last.words, word))), goes_on=True)

    def with_objects(self, role: str, phrases: tuple[NounPhrase, ...], *, after_article: bool) -> "ParsedClause":
        """With further objects, which fixed words right before them describe unless an article stands between."""
        fixed = self.fixed
        if self.goes_on and not (role or after_article or fixed[-1].role):
            fixed = (*fixed[:-1], fixed[-1]._replace(describes=True))
        return replace(self, roles=(*self.roles, (role, phrases)), fixed=fixed, goes_on=False)

    def about(self, phrase: NounPhrase) -> "ParsedClause":
        """With a direct object instead of "it" or none."""
        others = tuple((role, phrases) for role, phrases in self.roles if role != DIRECT)
        return replace(self, roles=((DIRECT, (phrase,)), *others))
