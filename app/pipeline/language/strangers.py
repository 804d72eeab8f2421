"""Objects in a place of an instruction where demonstrations have another kind of thing.

As in "close the door" where only a window was closed: the motion is that of the window.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from app.pipeline.language.grammar import ADJECTIVES, NOUN_KINDS
from app.pipeline.language.lexicon import phrase_of
from app.pipeline.language.mentions import clauses, mention_order, template


class Stranger(NamedTuple):
    """An object that stands where demonstrations have others.

    Attributes:
        instead_of: what they have there.
        named_elsewhere: whether taught instructions name it in another place: its part is another one.
    """

    name: str
    instead_of: tuple[str, ...]
    named_elsewhere: bool


def strangers(names: Sequence[str], instruction: str, taught: Sequence[str]) -> Iterator[Stranger]:
    """Of each clause the objects of another kind than the taught ones in their place.

    Args:
        names: the task's objects.
        instruction: in the form of taught ones.
    """
    parts = [(template(names, part), mention_order(names, part)) for text in taught for part in clauses(text)]
    known = {name for _, order in parts for name in order}
    usual = {(_verb(form), place, name) for form, order in parts for place, name in enumerate(order)}
    for part in clauses(instruction):
        form, order = template(names, part), mention_order(names, part)
        alike = [taught_order for taught_form, taught_order in parts if taught_form == form]
        for place, name in enumerate(order if alike else ()):
            there = tuple(dict.fromkeys(taught_order[place] for taught_order in alike))
            as_usual = (_verb(form), place, name) in usual  # put on another thing, but put
            if not as_usual and _kind(name).isdisjoint(frozenset().union(*map(_kind, there))):
                yield Stranger(name, there, name in known)


def _verb(form: str) -> str:
    return form.partition(" ")[0]


def _kind(name: str) -> frozenset[str]:
    """Its noun and those of the same kind."""
    words = [word for word in phrase_of(name) if word not in ADJECTIVES and len(word) > 1]
    noun = words[-1] if words else name
    return frozenset({noun}).union(*(kind for kind in NOUN_KINDS if noun in kind))
