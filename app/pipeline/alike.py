"""Several objects of one name in a scene: numbered by where they stand, never by the order in which they were sent.

The first stands farthest left as the robot sees it (world frame: the greatest y), then nearest (the least x), then
lowest. Objects of one name that stand almost equally far left may change their numbers from one look to the next: words
of place tell them apart, their numbers do not.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from app.pipeline.errors import ObjectSetError, UngroundedInstructionError
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import NUMBERED
from app.pipeline.order.order import Order
from app.pipeline.order.space import MARGIN_M
from roboprompt_client.arrays import Array

GOES_TO_M = 0.2  # a hand that closes, opens or is lowest within this of an object's origin may act on it,
CLEARLY = 2.0  # if all others of its name are so many times as far


class Alike(NamedTuple):
    """Objects that came with one name.

    Attributes:
        called: as they were sent.
        positions_m: (3,) by the name that each has here, in the order of the numbers.
    """

    called: str
    positions_m: Mapping[str, Array]

    @property
    def unsteady(self) -> frozenset[str]:
        """Those that another would take the number of if both moved a little."""
        names, left_m = list(self.positions_m), [float(place_m[1]) for place_m in self.positions_m.values()]
        close = [k for k in range(len(names) - 1) if left_m[k] - left_m[k + 1] < MARGIN_M]
        return frozenset(names[j] for k in close for j in (k, k + 1))


def numbered(
    names: Sequence[str], positions_m: Sequence[Sequence[float] | None]
) -> tuple[tuple[str, ...], tuple[Alike, ...]]:
    """The objects' names, of which no two are equal, and those that were.

    Raises:
        ObjectSetError: where a place is not known, two objects of one name stand in one place, or a number is taken.
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


def gone_to(alike: Alike, positions_m: Mapping[str, Array], acts_m: Array) -> tuple[str | None, ...]:
    """Which of them a hand goes to, in the order in which it does; None where that is not clear.

    Args:
        positions_m: (3,) of all objects of the scene.
        acts_m: (K, 3) where the hand closes, opens or is lowest.
    """
    found: dict[str | None, None] = {}
    names, places_m = list(alike.positions_m), np.array(list(alike.positions_m.values()))
    others_m = [place_m for name, place_m in positions_m.items() if name not in alike.positions_m]
    for act_m in acts_m:
        off_m = np.linalg.norm(places_m - act_m, axis=1)
        nearest, second = np.argsort(off_m)[:2]
        other_m = min((float(np.linalg.norm(place_m - act_m)) for place_m in others_m), default=np.inf)
        if off_m[nearest] <= min(GOES_TO_M, other_m):
            found[names[nearest] if off_m[second] >= CLEARLY * off_m[nearest] else None] = None
    return tuple(found)


def check_named(order: Order, followed: frozenset[str], groups: Sequence[Alike]) -> None:
    """Refuse what would depend on numbers that may change with the next look.

    Args:
        followed: the objects that the motion follows.

    Raises:
        UngroundedInstructionError: saying how to name the object.
    """
    said = {phrase.object_name for phrase in order.phrases if phrase.by == "name"}
    for alike in groups:
        if close := sorted(said & alike.unsteady):
            message = f"{close[0]!r} has its number by chance: another {alike.called} stands as far left"
            raise UngroundedInstructionError("instruction", message, f"the {alike.called} by its place, in words")
        if unnamed := sorted((followed & alike.positions_m.keys()).difference(order.objects)):
            message = f"does not say which {alike.called} is meant, and the motion follows {unnamed[0]}"
            valid = f"the {alike.called} by its place, also in demonstrations"
            raise UngroundedInstructionError("instruction", message, valid)


def alike_findings(groups: Sequence[Alike], instruction: str | None = None) -> Iterator[Finding]:
    """Says which number is where.

    Args:
        instruction: of an upload, as it is stored.
    """
    for alike in groups:
        places = ", ".join(f"{name} at ({x:.2f}, {y:.2f}, {z:.2f})" for name, (x, y, z) in alike.positions_m.items())
        message = f"{len(alike.positions_m)} objects are called {alike.called!r}; from left to right: {places}."
        if instruction is not None:
            message += f" The instruction is kept as {instruction!r}."
        yield NUMBERED.finding(message, f"objects[{alike.called}]", {"num_objects": len(alike.positions_m)})
