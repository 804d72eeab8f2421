"""Objects that stand to each other as in all demonstrations: a lid on its pot, a left cup left of a right one."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding
from app.pipeline.findings.places import FIXED_M, Range
from app.pipeline.findings.rules import ARRANGED, PARTED, SIDES
from app.pipeline.order.vocabulary import PLACE_WORDS
from app.pipeline.order.words import phrase_of
from app.pipeline.representation.anchors import OBJECT_FRAMES, AnchorFrame, object_rotation, tilted_objects
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

MIN_AGREEING = 3  # fewer demonstrations may agree by chance
MOVED_M = 0.05  # objects whose place varies by less never moved, and are no arrangement
FAR_M = ARRANGED.levels["warning"]
MANY = 8  # with fewer demonstrations, one side may be chance


@dataclass(frozen=True, eq=False)
class RigidPair:
    """Two objects with one relative position, in demonstrations at several places.

    Attributes:
        one: the object whose position is constant relative to `other`.
        frame: the frame of `other` in which it is.
        seen_m: the range of this relative position (3,).
        tilted: objects whose frames follow all of their rotation, not only the yaw.
    """

    one: str
    other: str
    frame: AnchorFrame
    seen_m: Range
    tilted: frozenset[str]

    def off_m(self, scene: Query) -> float:
        """Return the distance of `one` from its place in the arrangement."""
        seen_m = _seen_m(scene.object(self.one), scene.object(self.other), self.frame, self.tilted)
        return float(np.linalg.norm(self.seen_m.outside(seen_m)))


def rigid_pairs(shown: Sequence[Demonstration]) -> tuple[RigidPair, ...]:
    """Return the pairs of objects that keep one arrangement in all demonstrations, whether or not words name them."""
    if len(shown) < MIN_AGREEING:
        return ()
    tilted, names = tilted_objects(shown), [pose.name for pose in shown[0].objects]
    places_m = {name: Range.of([scene.object(name).position_m for scene in shown]) for name in names}
    moved = [name for name in names if places_m[name].width.max() > MOVED_M]
    found = [_rigid(one, other, shown, tilted) for one, other in combinations(moved, 2)]
    return tuple(pair for pair in found if pair is not None)


def _rigid(one: str, other: str, shown: Sequence[Demonstration], tilted: frozenset[str]) -> RigidPair | None:
    """Return the pair seen from the object and in the frame in which it varies least; None if it varies."""
    pairs = []
    for (seen, origin), frame in [((a, b), f) for a, b in ((one, other), (other, one)) for f in OBJECT_FRAMES]:
        seen_m = [_seen_m(scene.object(seen), scene.object(origin), frame, tilted) for scene in shown]
        pairs.append(RigidPair(seen, origin, frame, Range.of(seen_m), tilted))
    pair = min(pairs, key=lambda pair: float(pair.seen_m.width.max()))
    return pair if pair.seen_m.width.max() < FIXED_M else None


def _seen_m(one: ObjectPose, other: ObjectPose, frame: AnchorFrame, tilted: frozenset[str]) -> Array:
    """Return (3,) the position of one object in the frame of the other."""
    seen_m: Array = object_rotation(other, frame, tilted).inv().apply(one.position_m - other.position_m)
    return seen_m


def parted_findings(query: Query, pairs: Sequence[RigidPair], followed: frozenset[str]) -> Iterator[Finding]:
    """Yield a finding for the pair that is farthest from its arrangement, first of those that the motion follows.

    Args:
        followed: the objects that rows of the requested motion are relative to.
    """
    off = [(not followed.isdisjoint((pair.one, pair.other)), pair.off_m(query), pair) for pair in pairs]
    follows, off_m, pair = max(off, key=lambda item: (item[1] >= FAR_M, *item[:2]), default=(False, 0.0, None))
    if pair is not None:
        yield from _arranged_otherwise(pair.one, pair.other, off_m, is_followed=follows)


def arranged_findings(query: Query, shown: Sequence[Demonstration], followed: frozenset[str]) -> Iterator[Finding]:
    """Yield a finding if objects in two roles of the instruction are not arranged as in every demonstration."""
    asked, named = query.order.objects, [demonstration.order.objects for demonstration in shown]
    if any(len(names) != len(asked) for names in named):
        return
    for i, j in combinations(range(len(asked)), 2):
        pairs = [(d.object(names[i]), d.object(names[j])) for d, names in zip(shown, named, strict=True)]
        ways_m = Range.of([one.position_m - other.position_m for one, other in pairs])
        way_m = query.object(asked[i]).position_m - query.object(asked[j]).position_m
        same = ways_m.width < FIXED_M
        off_m = float((ways_m.outside(way_m) * same).max())
        if off_m >= FAR_M:
            follows = bool(same.all()) and not followed.isdisjoint((asked[i], asked[j]))
            yield from _arranged_otherwise(asked[i], asked[j], off_m, is_followed=follows)
            return


def _arranged_otherwise(one: str, other: str, off_m: float, *, is_followed: bool) -> tuple[Finding, ...]:
    message = (
        f"{one} is {100 * off_m:.1f} cm from its place relative to {other}, which is the same in every demonstration."
        " Check that neither is taken for another object, and put them together as demonstrated."
    )
    return (PARTED if is_followed else ARRANGED).findings(off_m, message, f"objects[{one}]", {"off_m": off_m})


class Side(NamedTuple):
    """`one` is on one side of `other` in all demonstrations: along x (0) or y (1), at less (-1) or more (1)."""

    one: str
    other: str
    axis: int
    sign: float


def sides(shown: Sequence[Demonstration]) -> tuple[Side, ...]:
    """Return the sides of pairs whose names differ only in a place, such as a left and a right cup.

    Other objects are often on one side by chance: in 2 of 44 correct scenes with noisy demonstrations.
    """
    found, names = [], [pose.name for pose in shown[0].objects] if len(shown) >= MANY else []
    things = {name: [word for word in phrase_of(name) if word not in PLACE_WORDS] for name in names}
    for one, other in combinations(names, 2):
        if things[one] == things[other]:
            ways_m = Range.of([d.object(one).position_m - d.object(other).position_m for d in shown])
            found += [Side(one, other, axis, 1.0) for axis in (0, 1) if ways_m.low[axis] > 0]
            found += [Side(one, other, axis, -1.0) for axis in (0, 1) if ways_m.high[axis] < 0]
    return tuple(found)


def sided_findings(query: Query, known: Sequence[Side], followed: frozenset[str]) -> Iterator[Finding]:
    """Yield a finding for a pair on the wrong side, if the motion follows or the instruction names one of them."""
    matter = followed.union(query.order.objects)
    for side in known:
        way_m = query.object(side.one).position_m - query.object(side.other).position_m
        off_m = -side.sign * float(way_m[side.axis])
        if not matter.isdisjoint((side.one, side.other)) and SIDES.severity(off_m) is not None:
            message = (
                f"{side.one} is {100 * off_m:.1f} cm on the wrong side of {side.other} along {'xy'[side.axis]}: in"
                " every demonstration it is on the other side. Check that neither is taken for the other."
            )
            yield SIDES.finding(message, f"objects[{side.one}]", {"off_m": off_m}, value=off_m)
            return
