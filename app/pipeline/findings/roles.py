"""Objects in a place of an instruction where demonstrations have another kind of thing.

As in "close the door" where only a window was closed: the motion is that of the window.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from app.pipeline.order.lexicon import phrase_of
from app.pipeline.order.order import Order
from app.pipeline.order.vocabulary import ADJECTIVES, NOUN_KINDS


class Stranger(NamedTuple):
    """An object that stands where demonstrations have others.

    Attributes:
        instead_of: what they have there.
        named_elsewhere: whether taught instructions name it in another place: its part is another one.
    """

    name: str
    instead_of: tuple[str, ...]
    named_elsewhere: bool


def strangers(asked: Order, taught: Sequence[str]) -> Iterator[Stranger]:
    """Of each clause the objects of another kind than the taught ones in their place.

    Args:
        asked: in the form of taught instructions.
    """
    shown = [clause for text in taught for clause in Order(text, asked.names).clauses]
    known = {name for clause in shown for name in clause.objects}
    usual = {(clause.verb, place, name) for clause in shown for place, name in enumerate(clause.objects)}
    for clause in asked.clauses:
        alike = [other.objects for other in shown if other.form == clause.form]
        for place, name in enumerate(clause.objects if alike else ()):
            there = tuple(dict.fromkeys(objects[place] for objects in alike))
            as_usual = (clause.verb, place, name) in usual  # put on another thing, but put
            if not as_usual and _kind(name).isdisjoint(frozenset().union(*map(_kind, there))):
                yield Stranger(name, there, name in known)


def _kind(name: str) -> frozenset[str]:
    """Its noun and those of the same kind."""
    words = [word for word in phrase_of(name) if word not in ADJECTIVES and len(word) > 1]
    noun = words[-1] if words else name
    return frozenset({noun}).union(*(kind for kind in NOUN_KINDS if noun in kind))
