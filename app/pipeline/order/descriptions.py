"""What a noun phrase states about an object, and which objects have these properties."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.space import Layout, Pick, by_distance, extreme
from app.pipeline.order.vocabulary import ADJECTIVES, PLACE_ADJECTIVES
from app.pipeline.order.words import noun_of

# How a phrase was matched to an object, by decreasing certainty. An answer reports the least certain of several.
MEANS = ("name", "alias", "taught", "color", "relation")


class NounPhrase(NamedTuple):
    """The words from `start` to `end` stand for `name`.

    Attributes:
        name: of the object; None for "it" and "them", and for an unknown thing in a clause that forbids something.
        by: how it was matched, one of `MEANS`.
        plural: whether its noun is in the plural, as the last one of "the red and the blue buttons".
        with_noun: whether it has a noun, unlike "the red" there.
        nested: whether it ends with another noun phrase: "the cup next to the plate".
        superfluous: whether it names the object without the relation at its end, which may then be a destination:
            "put mug 1 next to mug 2 on the tray".
    """

    start: int
    end: int
    name: str | None
    by: str
    plural: bool = False
    with_noun: bool = True
    nested: bool = False
    superfluous: bool = False


class Unmatched(NamedTuple):
    """The words from `start` to `end` are a noun phrase that matches no object of the task, or several."""

    start: int
    end: int
    candidates: tuple[str, ...]


class Description(NamedTuple):
    """The part of a noun phrase that is parsed so far, up to (not including) the word `end`.

    Attributes:
        exact: the object whose whole name or alias stands in it.
        words: its words from names and aliases; `kinds`: synonyms of nouns; `colors`: color words that no name has.
        picks: relations, in the order of the words.
        place: an ordinal whose side to count from is still to come.
        reach: "near" or "far" whose reference object is still to come.
        generic: whether it has "one" or "thing" as its noun.
        plural: whether its noun is in the plural.
        nested: whether it ends with another noun phrase: "the cup next to the plate".
        needed: the number of `picks` before the first relation that follows the noun without "that is".
        means: how its words are matched, of `MEANS`.
    """

    end: int
    exact: str | None = None
    words: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    colors: tuple[str, ...] = ()
    picks: tuple[Pick, ...] = ()
    place: int | None = None
    reach: str | None = None
    generic: bool = False
    plural: bool = False
    nested: bool = False
    needed: int | None = None
    means: frozenset[str] = frozenset({"name"})

    @property
    def says_something(self) -> bool:
        """Whether it can name an object. Colors and places need a noun: "the yellow" names none."""
        return self.has_noun or (bool(self.words) and not self.colors)

    @property
    def has_noun(self) -> bool:
        """Whether it has a noun, rather than adjectives alone."""
        return bool(self.exact or self.kinds or self.generic or not ADJECTIVES.issuperset(self.words))

    @property
    def is_place_alone(self) -> bool:
        """Whether it consists of "left" or "top" alone, which may be a direction instead."""
        return not self.has_noun and not self.colors and PLACE_ADJECTIVES.issuperset(self.words)

    def by(self) -> str:
        """Return the least certain of the means, one of `MEANS`."""
        return max(self.means, key=MEANS.index)

    def with_pick(self, pick: Pick, end: int, *, nested: bool = False) -> "Description":
        """Return it with a further relation, which may end with another noun phrase."""
        return self._replace(picks=(*self.picks, pick), means=self.means | {"relation"}, end=end, nested=nested)

    def reaching(self, other: str | None, end: int) -> "Description":
        """Return it with the pending `reach` measured from an object, or from the robot (None)."""
        pick = by_distance(other, self.place or 1, farthest=self.reach == "far")
        return self._replace(reach=None, place=None).with_pick(pick, end, nested=other is not None)

    def counted_from(self, side: str, end: int) -> "Description":
        """Return it with the pending ordinal counted from a side."""
        return self._replace(place=None).with_pick(extreme(side, self.place or 1), end)

    def candidates(self, lexicon: Lexicon, layout: Layout | None) -> tuple[str, ...]:
        """Return the objects that it matches, in the task's order."""
        complete = self.reaching(None, self.end) if self.reach else self
        named = complete._named(lexicon)
        if complete.place or (complete.picks and layout is None):
            return ()
        if not complete.picks or layout is None:
            return named
        if len(named) > 1:
            for pick in complete.picks:
                named = pick(layout, named)
            return _in_order(lexicon.names, named)
        # If the words alone match one object, the relation must be true of it: "the red button on the left".
        pool = complete._compared(lexicon)
        picked = [pick(layout, pool) for pick in complete.picks]
        agree = len(pool) > 1 and all(set(named) <= set(each) and len(each) < len(pool) for each in picked)
        return named if agree else ()

    def is_superfluous(self, lexicon: Lexicon, layout: Layout | None) -> bool:
        """Return whether the relations after the noun are not needed to tell its object."""
        if self.needed is None:
            return False
        return len(self._replace(picks=self.picks[: self.needed]).candidates(lexicon, layout)) == 1

    def _named(self, lexicon: Lexicon) -> tuple[str, ...]:
        sets = [lexicon.objects_of[word] for word in self.words]
        sets += [lexicon.of_color(color) for color in self.colors]
        if self.exact:
            sets.append(frozenset({self.exact}))
        if self.words and (called_so := lexicon.with_noun(self.words[-1])):
            sets.append(called_so)
        found = _common(lexicon.names, sets)
        if self.words and not (self.exact or self.generic or self.kinds):
            found = tuple(name for name in found if lexicon.is_meant(name, self.words))
        # Synonyms of nouns may confirm a match, but do not distinguish objects by themselves.
        kinds = [lexicon.kind_of(noun) for noun in self.kinds]
        confirms = len(found) == 1 or all(len(kind) > 1 for kind in kinds)
        return _common(found, kinds) if confirms else ()

    def _compared(self, lexicon: Lexicon) -> tuple[str, ...]:
        """Return the objects that a relation compares: those with the same noun, or all if no other has it."""
        noun = noun_of(lexicon.phrases[self.exact][0]) if self.exact else self.words[-1] if self.words else ""
        kind = lexicon.with_noun(noun)
        return _in_order(lexicon.names, kind) if len(kind) > 1 else lexicon.names


def _common(names: Sequence[str], sets: Iterable[frozenset[str]]) -> tuple[str, ...]:
    return _in_order(names, frozenset(names).intersection(*sets))


def _in_order(names: Sequence[str], wanted: Iterable[str]) -> tuple[str, ...]:
    chosen = frozenset(wanted)
    return tuple(name for name in names if name in chosen)
