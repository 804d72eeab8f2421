"""A parsed clause: its verb, its objects by role, and its other words as fixed phrases; which sequences are possible.

Fixed phrases are "to the left", "in the top drawer", "the dirt", "away". They are compared as wholes, with their
prepositions: "from 5 to 2" has the same words as "from 2 to 5". A phrase of direction, number or manner must not be
left out, since its opposite is another motion; a place may be, as long as no other place was taught.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import NamedTuple

from app.pipeline.order.descriptions import NounPhrase
from app.pipeline.order.verbs import FAMILIES, PICKING, Family
from app.pipeline.order.vocabulary import (
    ADJECTIVES,
    ALTERING,
    DECIDING,
    DESTINATIONS,
    DIRECTIONS,
    LOCATIONS,
    RETURNING,
)

DIRECT = ""  # the role of a direct object; the others are named after prepositions
INSTRUMENT, SOURCE = "with", "off"  # the roles that may be left out


class FixedPhrase(NamedTuple):
    """Words that belong together.

    Attributes:
        role: of the preposition before them (see `vocabulary.PREPOSITIONS`); empty without one.
        describes: whether they stand right before an object, as "red" in "the red button" if no object name has "red".
    """

    role: str
    words: tuple[str, ...]
    describes: bool = False

    @property
    def decides(self) -> bool:
        """Whether a clause would mean something else without them."""
        deciding = ALTERING if self.role in LOCATIONS else DECIDING
        decides = any(word in deciding or word.isdigit() for word in self.words)
        return decides and not (self.describes and ADJECTIVES.issuperset(self.words))

    @property
    def is_loose(self) -> bool:
        """Whether they stand without a preposition and may be left out."""
        return not self.role and not self.decides


Signature = tuple[str | None, tuple[tuple[str, int], ...], tuple[FixedPhrase, ...]]


def fits(asked: Sequence[FixedPhrase], taught: Sequence[FixedPhrase], *, has_destination: bool) -> bool:
    """Return whether a clause with the phrases `asked` means the same as one taught with the phrases `taught`."""
    remaining = Counter((phrase.role, phrase.words) for phrase in taught)
    loose = {word for phrase in taught if not phrase.role for word in phrase.words}
    repeating = {(word,) for word in RETURNING} if has_destination else set()
    for phrase in asked:
        whole = next((key for key in _keys(phrase) if remaining[key]), None)
        if whole is not None:
            remaining[whole] -= 1
        elif not phrase.role and phrase.words in repeating:
            continue
        elif phrase.role or phrase.decides or not loose.issuperset(phrase.words):
            return False
    return not any(remaining[phrase.role, phrase.words] for phrase in taught if phrase.decides)


def _keys(phrase: FixedPhrase) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return the taught (role, words) that a phrase matches: "left" also matches "to the left"."""
    own = (phrase.role, phrase.words)
    return (own,) if phrase.role or phrase.describes else (own, ("to", phrase.words))


def without(group: Sequence[NounPhrase], excepted: Sequence[NounPhrase]) -> tuple[NounPhrase, ...]:
    """Return the objects of "all mugs" without the excepted ones; empty if these do not belong to the group."""
    names = {phrase.name for phrase in excepted}
    left = tuple(phrase for phrase in group if phrase.name not in names)
    is_group = len(group) > 1 and len({(phrase.start, phrase.end) for phrase in group}) == 1
    return left if is_group and names and len(left) == len(group) - len(names) else ()


@dataclass(frozen=True)
class ParsedClause:
    """One thing to do.

    Attributes:
        verb: in its base form, with its particle; None where a noun phrase stands alone.
        roles: the objects, in their order, by preposition (see `vocabulary.PREPOSITIONS`) or `DIRECT`.
        fixed: phrases that name no object, as "the dirt" in "sweep the dirt to the dustpan".
        goes_on: whether a further word continues the last phrase of `fixed`, with no object between.
    """

    verb: str | None
    roles: tuple[tuple[str, tuple[NounPhrase, ...]], ...] = ()
    fixed: tuple[FixedPhrase, ...] = ()
    goes_on: bool = False

    def objects_in(self, role: str) -> tuple[NounPhrase, ...]:
        """Return the objects in a role; empty if there are none."""
        return dict(self.roles).get(role, ())

    def names_in(self, role: str) -> set[str]:
        """Return the names of the objects in a role."""
        return {phrase.name for phrase in self.objects_in(role) if phrase.name}

    def families_with(self, verb: str | None) -> list[Family]:
        """Return the families of similar verbs that contain both its verb and another."""
        roles = {role for role, _ in self.roles if role != DIRECT}
        sides = any(not DIRECTIONS.isdisjoint(phrase.words) for phrase in self.fixed if phrase.role in ("", "to"))
        toward = roles | {"to"} if sides else roles
        alike = [family for family in FAMILIES if {verb, self.verb} <= family.verbs]
        return [family for family in alike if family.holds(roles) or family.holds(toward)]

    @property
    def has_destination(self) -> bool:
        """Whether it says where something goes."""
        return any(role in DESTINATIONS for role, _ in self.roles)

    @property
    def names_a_thing(self) -> bool:
        """Whether it says nothing but an object: "the red button"."""
        return self.verb is None and [role for role, _ in self.roles] == [DIRECT] and not self.fixed

    @property
    def has_two_destinations(self) -> bool:
        """Whether a relation that no object needs may be a destination beside another one."""
        somewhere = self.has_destination or any(phrase.role in DESTINATIONS for phrase in self.fixed)
        return somewhere and any(phrase.superfluous for phrase in self.phrases)

    @property
    def picks_up(self) -> bool:
        """Whether its object stays in the hand."""
        return self.verb in PICKING and {role for role, _ in self.roles} <= {DIRECT}

    @property
    def moves_object(self) -> bool:
        """Whether its object is elsewhere afterwards: it picks up, has a destination, or "off"."""
        return self.picks_up or self.has_destination or bool(self.objects_in(SOURCE))

    @property
    def phrases(self) -> tuple[NounPhrase, ...]:
        """All of its objects."""
        return tuple(phrase for _, phrases in self.roles for phrase in phrases)

    @property
    def signature(self) -> Signature:
        """The verb and the roles, independent of the objects."""
        return self.verb, tuple(sorted((role, len(phrases)) for role, phrases in self.roles)), self.fixed_phrases

    @cached_property
    def fixed_phrases(self) -> tuple[FixedPhrase, ...]:
        """The fixed phrases, sorted: their order has no meaning."""
        return tuple(sorted(self.fixed))

    def with_fixed(self, role: str, word: str) -> "ParsedClause":
        """Return it with a further fixed word, after a preposition or without one."""
        *others, last = self.fixed if self.goes_on and not role else (*self.fixed, FixedPhrase(role, ()))
        return replace(self, fixed=(*others, last._replace(words=(*last.words, word))), goes_on=True)

    def with_objects(self, role: str, phrases: tuple[NounPhrase, ...], *, after_article: bool) -> "ParsedClause":
        """Return it with further objects; fixed words right before them, without an article between, describe them."""
        fixed = self.fixed
        if self.goes_on and not (role or after_article or fixed[-1].role):
            fixed = (*fixed[:-1], fixed[-1]._replace(describes=True))
        return replace(self, roles=(*self.roles, (role, phrases)), fixed=fixed, goes_on=False)

    def with_role(self, role: str, phrases: tuple[NounPhrase, ...]) -> "ParsedClause":
        """Return it with these objects in the role, instead of those that were there."""
        return replace(self, roles=tuple((dict(self.roles) | {role: phrases}).items()))

    def about(self, phrases: tuple[NounPhrase, ...]) -> "ParsedClause":
        """Return it with these objects in place of its pronoun ("it", "them")."""
        roles = tuple((role, phrases if any(each.name is None for each in had) else had) for role, had in self.roles)
        return replace(self, roles=roles)


def uses_moved_object(clauses: Sequence[ParsedClause]) -> bool:
    """Return whether a clause uses an object that an earlier one moved, or moves one that something was put on.

    Places are known only before the first action, and a covered object cannot be grasped as it was taught. Picking the
    same object up twice in a row is allowed.
    """
    moved, covered = set[str](), set[str]()
    for before, clause in pairwise((None, *clauses)):
        assert clause is not None
        direct = clause.names_in(DIRECT)
        again = before is not None and before.picks_up and clause.picks_up and direct == before.names_in(DIRECT)
        if not again and not moved.isdisjoint(phrase.name for phrase in clause.phrases):
            return True
        if clause.moves_object:
            if not covered.isdisjoint(direct):
                return True
            moved |= direct
            covered |= clause.names_in("on")
    return False


def needs_free_hand(clauses: Sequence[ParsedClause]) -> bool:
    """Return whether a clause is about other objects than the one that the hand holds, or picks up another one."""
    held = set[str]()
    for clause in clauses:
        direct = clause.names_in(DIRECT)
        elsewhere = bool(held) and held.isdisjoint(phrase.name for phrase in clause.phrases)
        if elsewhere or (clause.picks_up and len(held | direct) > 1):
            return True
        if clause.moves_object:
            held = direct if clause.picks_up else set()
    return False


def is_placed_after_moving(clauses: Sequence[ParsedClause]) -> bool:
    """Return whether a clause identifies an object by its place after something was moved."""
    return any(
        earlier.moves_object and any(phrase.by == "relation" for phrase in later.phrases)
        for earlier, later in combinations(clauses, 2)
    )
