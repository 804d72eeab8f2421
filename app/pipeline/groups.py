"""Items grouped by a key, in the order in which keys first appear."""

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeVar

Key = TypeVar("Key", bound=Hashable)
Item = TypeVar("Item")
Made = TypeVar("Made")


def grouped(items: Iterable[Item], key: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """Return the items of each key."""
    groups: dict[Key, list[Item]] = defaultdict(list)
    for item in items:
        groups[key(item)].append(item)
    return groups


def places_by(items: Sequence[Item], key: Callable[[Item], Key]) -> dict[Key, list[int]]:
    """Return the indices of the items of each key."""
    return grouped(range(len(items)), lambda place: key(items[place]))


def made_by_group(
    items: Sequence[Item], key: Callable[[Item], Hashable], make: Callable[[list[Item]], Iterable[Made]]
) -> tuple[Made, ...]:
    """Return what `make` makes of each item among those of its key, in the order of the items."""
    made: dict[int, Made] = {}
    for places in places_by(items, key).values():
        made.update(zip(places, make([items[place] for place in places]), strict=True))
    return tuple(made[place] for place in range(len(items)))
