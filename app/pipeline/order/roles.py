"""Objects in roles in which demonstrations have another kind of thing."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from app.pipeline.order.order import Order
from app.pipeline.order.vocabulary import ADJECTIVES, NOUN_KINDS
from app.pipeline.order.words import phrase_of


class Stranger(NamedTuple):
    """An object that the instruction has in the role of another kind of thing.

    Attributes:
        instead_of: the objects that demonstrations have in this role.
        named_elsewhere: whether taught instructions have it in another role.
    """

    name: str
    instead_of: tuple[str, ...]
    named_elsewhere: bool


def strangers(asked: Order, taught: Sequence[str]) -> Iterator[Stranger]:
    """Yield the objects of each clause that are of another kind than the taught ones in their role."""
    shown = [clause for text in taught for clause in Order(text, asked.names).clauses]
    known = {name for clause in shown for name in clause.objects}
    usual = {(clause.verb, place, name) for clause in shown for place, name in enumerate(clause.objects)}
    for clause in asked.clauses:
        alike = [other.objects for other in shown if other.form == clause.form]
        for place, name in enumerate(clause.objects if alike else ()):
            there = tuple(dict.fromkeys(objects[place] for objects in alike))
            as_usual = (clause.verb, place, name) in usual  # the same object in the same role
            if not as_usual and _kind(name).isdisjoint(frozenset().union(*map(_kind, there))):
                yield Stranger(name, there, name in known)


def _kind(name: str) -> frozenset[str]:
    words = [word for word in phrase_of(name) if word not in ADJECTIVES and len(word) > 1]
    noun = words[-1] if words else name
    return frozenset({noun}).union(*(kind for kind in NOUN_KINDS if noun in kind))
