"""What a noun phrase says of an object, and the objects of which it is true."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from app.pipeline.order.lexicon import Lexicon, noun_of
from app.pipeline.order.space import Layout, Pick, by_distance, extreme
from app.pipeline.order.vocabulary import ADJECTIVES, PLACE_ADJECTIVES

# How an object was found, the least certain last: that is what an answer says of a phrase that used several.
MEANS = ("name", "alias", "taught", "spelling", "color", "relation")


class Description(NamedTuple):
    """What was said so far, up to the word `end`.

    Attributes:
        exact: the object whose whole name or alias was said.
        words: of names and aliases; `kinds` nouns that may stand for one, `colors` color words that no name has.
        picks: relations, in the order in which they were said.
        place: an ordinal that waits for a side to count from.
        reach: "near" or "far", which waits for what it is near to or far from.
        generic: whether "one" or "thing" was said.
        plural: whether the noun stands in the plural.
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
    means: frozenset[str] = frozenset({"name"})

    @property
    def says_something(self) -> bool:
        """Whether it can stand for an object: colors and places only with a noun, for "the lemon" is no yellow cup."""
        noun = bool(self.exact or self.words or self.kinds or self.generic)
        return noun and not (self.colors and not self.has_noun)

    @property
    def has_noun(self) -> bool:
        """Whether it says what the object is, and not only which one."""
        return bool(self.exact or self.kinds or self.generic or not ADJECTIVES.issuperset(self.words))

    @property
    def is_place_alone(self) -> bool:
        """Whether it is nothing but "left" or "top", which may as well say where to."""
        return not self.has_noun and not self.colors and PLACE_ADJECTIVES.issuperset(self.words)

    def by(self) -> str:
        """The least certain of the means."""
        return max(self.means, key=MEANS.index)

    def with_pick(self, pick: Pick, end: int) -> "Description":
        """With a further relation."""
        return self._replace(picks=(*self.picks, pick), means=self.means | {"relation"}, end=end)

    def reaching(self, other: str | None, end: int) -> "Description":
        """The pending nearest or farthest is measured from an object, or from the robot."""
        pick = by_distance(other, self.place or 1, farthest=self.reach == "far")
        return self._replace(reach=None, place=None).with_pick(pick, end)

    def counted_from(self, side: str, end: int) -> "Description":
        """The pending ordinal counts from a side."""
        return self._replace(place=None).with_pick(extreme(side, self.place or 1), end)

    def candidates(self, lexicon: Lexicon, layout: Layout | None) -> tuple[str, ...]:
        """The objects that it may mean, in the task's order; several if it does not tell them apart."""
        complete = self.reaching(None, self.end) if self.reach else self
        named = complete._named(lexicon)
        if not complete.picks:
            return () if complete.place else named
        if layout is None or complete.place:
            return ()
        if len(named) > 1:
            for pick in complete.picks:
                named = pick(layout, named)
            return _in_order(lexicon.names, named)
        # What is clear without the relation must agree with it: "the red button on the left" may be on the right.
        pool = complete._compared(lexicon)
        picked = [pick(layout, pool) for pick in complete.picks]
        agree = len(pool) > 1 and all(set(named) <= set(each) and len(each) < len(pool) for each in picked)
        return named if agree else ()

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
        # Nouns of the same kind confirm what else was said; alone they tell nothing apart.
        kinds = [lexicon.kind_of(noun) for noun in self.kinds]
        confirms = len(found) == 1 or all(len(kind) > 1 for kind in kinds)
        return _common(found, kinds) if confirms else ()

    def _compared(self, lexicon: Lexicon) -> tuple[str, ...]:
        """What a relation compares an object with: the others of its noun, or all others where there is none."""
        noun = noun_of(lexicon.phrases[self.exact][0]) if self.exact else self.words[-1] if self.words else ""
        kind = lexicon.with_noun(noun)
        return _in_order(lexicon.names, kind) if len(kind) > 1 else lexicon.names


def _common(names: Sequence[str], sets: Iterable[frozenset[str]]) -> tuple[str, ...]:
    return _in_order(names, frozenset(names).intersection(*sets))


def _in_order(names: Sequence[str], wanted: Iterable[str]) -> tuple[str, ...]:
    chosen = frozenset(wanted)
    return tuple(name for name in names if name in chosen)
