"""Objects that stand to each other as in all demonstrations: a lid on its pot, two parts of one thing.

Whether words name them does not matter: the motion was shown with both where they were.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import ARRANGED, CHANGED_PLACES, PARTED, SIDES
from app.pipeline.order.lexicon import phrase_of
from app.pipeline.order.vocabulary import PLACE_WORDS
from app.pipeline.representation.anchors import OBJECT_FRAMES, Frame, object_rotation, tilted_objects
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

RIGID_M = 0.01  # what varies by less is the same in all demonstrations
FEWEST = 3  # demonstrations that tell what is the same from chance
MOVED_M = 0.05  # a pair that never stood elsewhere is two objects that never moved

MANY = 8  # demonstrations that tell a side from chance
SAME_PLACE_M = 0.03  # what is seen so near to where another was is at its place


@dataclass(frozen=True, eq=False)
class RigidPair:
    """Two objects in one arrangement, which demonstrations have at different places.

    Attributes:
        one: what stands somewhere, seen from `other`.
        frame: of `other` in which it does.
        low_m, high_m: (3,) the box of where it does.
        tilted: objects whose frames turn with them fully.
    """

    one: str
    other: str
    frame: Frame
    low_m: Array
    high_m: Array
    tilted: frozenset[str]

    def off_m(self, scene: Query) -> float:
        """How far `one` is from where the arrangement has it."""
        seen_m = _seen_m(scene.object(self.one), scene.object(self.other), self.frame, self.tilted)
        return float(np.linalg.norm(outside_m(seen_m, self.low_m, self.high_m)))


def outside_m(place_m: Array, low_m: Array, high_m: Array) -> Array:
    """(3,) how far a place lies outside of a box."""
    outside: Array = np.maximum(place_m - high_m, 0) + np.maximum(low_m - place_m, 0)
    return outside


def rigid_pairs(shown: Sequence[Demonstration]) -> tuple[RigidPair, ...]:
    """Of the objects that all demonstrations have, by their names, the pairs that keep one arrangement."""
    if len(shown) < FEWEST:
        return ()
    tilted, names = tilted_objects(shown), [pose.name for pose in shown[0].objects]
    places_m = {name: np.array([scene.object(name).position_m for scene in shown]) for name in names}
    moved = [name for name in names if np.ptp(places_m[name], axis=0).max() > MOVED_M]
    found = [_rigid(one, other, shown, tilted) for one, other in combinations(moved, 2)]
    return tuple(pair for pair in found if pair is not None)


def _rigid(one: str, other: str, shown: Sequence[Demonstration], tilted: frozenset[str]) -> RigidPair | None:
    """The pair in the frame in which it varies least, if that is little."""
    pairs = []
    for (seen, origin), frame in [((a, b), f) for a, b in ((one, other), (other, one)) for f in OBJECT_FRAMES]:
        poses = [(scene.object(seen), scene.object(origin)) for scene in shown]
        seen_m = np.array([_seen_m(*pair, frame, tilted) for pair in poses])
        low_m, high_m = seen_m.min(axis=0), seen_m.max(axis=0)
        pairs.append((float((high_m - low_m).max()), RigidPair(seen, origin, frame, low_m, high_m, tilted)))
    spread_m, pair = min(pairs, key=lambda item: item[0])
    return pair if spread_m < RIGID_M else None


def _seen_m(one: ObjectPose, other: ObjectPose, frame: Frame, tilted: frozenset[str]) -> Array:
    """(3,) where one object is, seen from the other."""
    seen_m: Array = object_rotation(other, frame, tilted).inv().apply(one.position_m - other.position_m)
    return seen_m


def parted_findings(query: Query, pairs: Sequence[RigidPair], followed: frozenset[str]) -> Iterator[Finding]:
    """The pair that is farthest from its arrangement; those that the motion follows count before others.

    Args:
        followed: the objects that rows of the asked motion are relative to.
    """
    off = [(not followed.isdisjoint((pair.one, pair.other)), pair.off_m(query), pair) for pair in pairs]
    parted = [item for item in off if ARRANGED.severity(item[1]) is not None]
    if not parted:
        return
    follows, off_m, pair = max(parted, key=lambda item: item[:2])
    message = (
        f"{pair.one} is {100 * off_m:.1f} cm from where it stands to {pair.other} in every demonstration, as if they"
        " were one thing: is one taken for another, or were they parted?"
    )
    rule = PARTED if follows else ARRANGED
    yield rule.finding(message, f"objects[{pair.one}]", {"off_m": off_m}, value=off_m)


def arranged_findings(query: Query, shown: Sequence[Demonstration], followed: frozenset[str]) -> Iterator[Finding]:
    """Objects that the instruction names stand to each other as in every demonstration, whichever they are."""
    asked, named = query.order.objects, [demonstration.order.objects for demonstration in shown]
    if any(len(names) != len(asked) for names in named):
        return
    for i, j in combinations(range(len(asked)), 2):
        pairs = [(d.object(names[i]), d.object(names[j])) for d, names in zip(shown, named, strict=True)]
        ways_m = np.array([one.position_m - other.position_m for one, other in pairs])
        way_m = query.object(asked[i]).position_m - query.object(asked[j]).position_m
        same = np.ptp(ways_m, axis=0) < RIGID_M
        off_m = float((outside_m(way_m, ways_m.min(axis=0), ways_m.max(axis=0)) * same).max())
        if ARRANGED.severity(off_m) is not None:
            message = (
                f"{asked[i]} lies {100 * off_m:.1f} cm from where it stands to {asked[j]} in every demonstration: is"
                " one taken for the other?"
            )
            follows = same.all() and not followed.isdisjoint((asked[i], asked[j]))
            rule = PARTED if follows else ARRANGED
            yield rule.finding(message, f"objects[{asked[i]}]", {"off_m": off_m}, value=off_m)
            return


class Side(NamedTuple):
    """`one` stands on one side of `other` in all demonstrations: along x (0) or y (1), before (-1) or behind it (1)."""

    one: str
    other: str
    axis: int
    sign: float


def sides(shown: Sequence[Demonstration]) -> tuple[Side, ...]:
    """Where two objects always stand to each other whose names say no more than where: a left and a right cup.

    Others come to stand on one side by chance: of 44 right scenes with noisy demonstrations in two.
    """
    found = []
    for one, other in combinations([pose.name for pose in shown[0].objects] if len(shown) >= MANY else (), 2):
        if _without_place(one) != _without_place(other):
            continue
        ways_m = np.array([d.object(one).position_m - d.object(other).position_m for d in shown])
        for axis in (0, 1):
            sign = float(np.sign(ways_m[0, axis]))
            if (sign * ways_m[:, axis]).min() > 0:
                found.append(Side(one, other, axis, sign))
    return tuple(found)


def _without_place(name: str) -> list[str]:
    """The words of a name but those that say where it stands: of a left and a right cup both times `cup`."""
    return [word for word in phrase_of(name) if word not in PLACE_WORDS]


def sided_findings(query: Query, known: Sequence[Side], followed: frozenset[str]) -> Iterator[Finding]:
    """A pair on its wrong side, one of which the motion follows or words name."""
    matter = followed.union(query.order.objects)
    for side in known:
        way_m = query.object(side.one).position_m - query.object(side.other).position_m
        off_m = -side.sign * float(way_m[side.axis])
        if not matter.isdisjoint((side.one, side.other)) and SIDES.severity(off_m) is not None:
            message = (
                f"{side.one} stands {100 * off_m:.1f} cm on the other side of {side.other}, along {'xy'[side.axis]},"
                " than in every demonstration: is one taken for the other?"
            )
            yield SIDES.finding(message, f"objects[{side.one}]", {"off_m": off_m}, value=off_m)
            return


def changed_places(before: Sequence[ObjectPose], now: Sequence[ObjectPose]) -> Iterator[Finding]:
    """Two objects that are each where the other was one step before."""
    was_m = {pose.name: pose.position_m for pose in before}
    for one, other in combinations([pose for pose in now if pose.name in was_m], 2):
        apart_m = float(np.linalg.norm(was_m[one.name] - was_m[other.name]))
        off_m = max(np.linalg.norm(a.position_m - was_m[b.name]) for a, b in ((one, other), (other, one)))
        if off_m < min(SAME_PLACE_M, apart_m / 3):
            message = (
                f"{one.name} and {other.name} have changed places since the last step: one is taken for the other."
            )
            yield CHANGED_PLACES.finding(message, f"objects[{one.name}]", {"apart_m": apart_m})
