"""Several objects of one name in a scene, numbered by their positions.

The first has the greatest y in the world frame, which is farthest left for a robot that looks along +x; then the least
x, then the least z. Objects of one name with almost equal y may change their numbers from one look to the next: words
of place tell them apart, their numbers do not.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from app.pipeline.errors import ObjectSetError, UngroundedInstructionError
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import NUMBERED
from app.pipeline.order.order import FIELD, Order
from app.pipeline.order.space import MARGIN_M
from roboprompt_client.types.arrays import Array

PLACE_EXAMPLE = "the left one, the one next to another object"


class Alike(NamedTuple):
    """Objects that came with one name.

    Attributes:
        called: the name as sent.
        positions_m: (3,) by numbered name, in the order of the numbers.
    """

    called: str
    positions_m: Mapping[str, Array]

    @property
    def unsteady(self) -> frozenset[str]:
        """The objects whose numbers change if they move a little."""
        names, left_m = list(self.positions_m), [float(place_m[1]) for place_m in self.positions_m.values()]
        close = [k for k in range(len(names) - 1) if left_m[k] - left_m[k + 1] < MARGIN_M]
        return frozenset(names[j] for k in close for j in (k, k + 1))


def numbered(
    names: Sequence[str], positions_m: Sequence[Sequence[float] | None]
) -> tuple[tuple[str, ...], tuple[Alike, ...]]:
    """Return the names with equal ones numbered, and the groups of equal ones.

    Raises:
        ObjectSetError: if a position is unknown, two objects of one name are in one place, or a name is taken.
    """
    found, groups = list(names), []
    for name in [name for name in dict.fromkeys(names) if names.count(name) > 1]:
        places = [k for k, other in enumerate(names) if other == name]
        known_m = [np.array(place_m, dtype=float) for k in places if (place_m := positions_m[k]) is not None]
        if len(known_m) < len(places):
            message = f"given twice: {name}, and where each stands is not known beforehand"
            raise ObjectSetError("objects", message, "a name for each, or the position of each")
        ordered = sorted(range(len(places)), key=lambda k: (-known_m[k][1], known_m[k][0], known_m[k][2]))
        for number, k in enumerate(ordered, start=1):
            found[places[k]] = f"{name} {number}"
        groups.append(Alike(name, {found[places[k]]: known_m[k] for k in ordered}))
        _check(groups[-1], names)
    return tuple(found), tuple(groups)


def _check(alike: Alike, names: Sequence[str]) -> None:
    if taken := next((name for name in alike.positions_m if name in names), None):
        raise ObjectSetError("objects", f"given twice: {alike.called}, and {taken} is there already", "other names")
    places_m = np.array(list(alike.positions_m.values()))
    apart_m = np.linalg.norm(places_m[:, None] - places_m[None], axis=2) + np.eye(len(places_m)) * MARGIN_M
    if apart_m.min() < MARGIN_M:
        message = f"given twice: {alike.called}, {100 * apart_m.min():.1f} cm apart: one object that was found twice?"
        raise ObjectSetError("objects", message, f"objects of one name {100 * MARGIN_M:.0f} cm apart or more")


def alike_findings(groups: Sequence[Alike], instruction: str | None = None) -> Iterator[Finding]:
    """Yield a finding for each group that says where each number is.

    Args:
        instruction: of an upload, as it is stored.
    """
    for alike in groups:
        places = ", ".join(f"{name} at ({x:.2f}, {y:.2f}, {z:.2f})" for name, (x, y, z) in alike.positions_m.items())
        message = f"{len(alike.positions_m)} objects are called {alike.called!r}; from left to right: {places}."
        if instruction is not None:
            message += f" The instruction is kept as {instruction!r}."
        yield NUMBERED.finding(message, f"objects[{alike.called}]", {"num_objects": len(alike.positions_m)})


def check_named(order: Order, followed: frozenset[str], groups: Sequence[Alike]) -> None:
    """Refuse an instruction whose meaning depends on numbers that may change with the next observation.

    Args:
        followed: the objects that the motion follows.

    Raises:
        UngroundedInstructionError: its `valid` says how to name the object.
    """
    said = {phrase.object_name for phrase in order.phrases if phrase.by == "name"}
    for alike in groups:
        if close := sorted(said & alike.unsteady):
            message = f"{close[0]!r} may be another {alike.called} at the next look: two stand almost equally far left"
            raise UngroundedInstructionError(FIELD, message, f"words of place instead of a number: {PLACE_EXAMPLE}")
        if unnamed := sorted((followed & alike.positions_m.keys()).difference(order.objects)):
            message = f"does not say which {alike.called} is meant, and the motion follows {unnamed[0]}"
            valid = f"words of place, also in demonstrations: {PLACE_EXAMPLE}"
            raise UngroundedInstructionError(FIELD, message, valid)
