"""The scenes of a task's demonstrations: places of objects, distances of hands, and objects in one arrangement."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, permutations, product
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding
from app.pipeline.findings.places import FIXED_M, MANY, Range, ShownPlaces
from app.pipeline.findings.rules import ARRANGEMENT, ARRANGEMENT_OF_FOLLOWED, ARRANGEMENT_OF_SIDES, Rule
from app.pipeline.order.vocabulary import PLACE_WORDS
from app.pipeline.order.words import phrase_of
from app.pipeline.representation.anchors import OBJECT_FRAMES, Anchor, tilted_objects
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

HAND = "the end effector"
MIN_AGREEING = 3  # fewer demonstrations may agree by chance
MOVED_M = 0.05  # objects whose place varies by less never moved, and are no arrangement
TURNED_DEG = 20.0  # less turn does not tell an object's axes from the world's
MANY_OF_A_SIDE = 8  # with fewer demonstrations, one side may be chance


@dataclass(frozen=True, eq=False)
class RigidPair:
    """Two objects with one relative position, or one along some axes, in demonstrations at several places.

    Attributes:
        one: the name, or the role in instructions, of the object whose position is constant relative to `other`.
        anchor: `other` and its frame in which it is.
        seen_m: the range of this relative position (3,).
        axes: those of `other` along which it is constant.
    """

    one: str
    other: str
    anchor: Anchor
    seen_m: Range
    axes: tuple[int, ...] = (0, 1, 2)

    @property
    def along(self) -> str:
        """The axes in messages; nothing if it is constant along all."""
        return "" if len(self.axes) == 3 else f" along its {', '.join('xyz'[axis] for axis in self.axes)}"

    def off_m(self, poses: Mapping[str, ObjectPose]) -> float:
        """Return the distance of `one` from its place, of poses by name and role; 0 where either is missing."""
        if not {self.one, self.other} <= poses.keys():
            return 0.0
        seen_m = _seen_m(poses[self.one], poses[self.other], self.anchor)
        return float(np.linalg.norm(self.seen_m.outside(seen_m)[list(self.axes)]))


class Side(NamedTuple):
    """`one` is beside `other` in all demonstrations: along x (0) or y (1), on the side of less (-1) or more (1)."""

    one: str
    other: str
    axis: int
    sign: int


@dataclass(frozen=True, eq=False)
class ShownScenes:
    """The scenes of demonstrations; what is derived from them is computed once.

    Attributes:
        left_out: demonstrations of plans that no prompt shows.
    """

    demonstrations: tuple[Demonstration, ...]
    left_out: tuple[Demonstration, ...] = ()

    @cached_property
    def places(self) -> dict[str, ShownPlaces]:
        """The range of each object's places, by its name."""
        names = [pose.name for pose in self.demonstrations[0].objects]
        return {name: ShownPlaces.of([item.object(name) for item in self.demonstrations]) for name in names}

    @cached_property
    def passed_m(self) -> dict[str, float]:
        """The least distances of hands from objects, by name and by role in the instruction, as `<0>`."""
        found: dict[str, float] = {}
        for shown in self.demonstrations:
            for pose in shown.objects if shown.actions else ():
                near_m = float(distances_m(path_m(shown.start, shown.actions), pose.position_m).min())
                for key in (pose.name, shown.order.placeholder(pose.name)):
                    found[key] = min(near_m, found.get(key, math.inf))
        return found

    @cached_property
    def starts(self) -> ShownPlaces | None:
        """The range of the hand's places before the first action; None if any is not known."""
        poses = [ObjectPose(HAND, item.start.position_m) for item in self.demonstrations if item.start is not None]
        return ShownPlaces.of(poses) if poses and len(poses) == len(self.demonstrations) else None

    @cached_property
    def pairs(self) -> tuple[RigidPair, ...]:
        """The pairs of objects, or of roles in the instruction, that keep one arrangement in all demonstrations."""
        if len(self.demonstrations) < MIN_AGREEING:
            return ()
        tilted, scenes = tilted_objects(self.demonstrations), [_by_role(scene) for scene in self.demonstrations]
        shared = [key for key in scenes[0] if all(key in poses for poses in scenes)]
        places_m = {key: Range.of([poses[key].position_m for poses in scenes]) for key in shared}
        moved = [key for key in shared if places_m[key].width.max() > MOVED_M]
        found = [_rigid(one, other, scenes, tilted) for one, other in combinations(moved, 2)]
        return tuple(pair for pair in found if pair is not None)

    @cached_property
    def sides(self) -> tuple[Side, ...]:
        """The sides of pairs whose names differ only in a place, such as a left and a right cup.

        Other objects are often on one side by chance: in 2 of 44 correct scenes with noisy demonstrations.
        """
        if len(self.demonstrations) < MANY_OF_A_SIDE:
            return ()
        found, names = [], [pose.name for pose in self.demonstrations[0].objects]
        things = {name: [word for word in phrase_of(name) if word not in PLACE_WORDS] for name in names}
        for one, other in combinations(names, 2):
            if things[one] == things[other]:
                ways_m = Range.of([_way_m(scene, one, other) for scene in self.demonstrations])
                found += [Side(one, other, axis, 1) for axis in (0, 1) if ways_m.low[axis] > 0]
                found += [Side(one, other, axis, -1) for axis in (0, 1) if ways_m.high[axis] < 0]
        return tuple(found)

    @cached_property
    def least_apart_m(self) -> dict[tuple[str, str], float]:
        """The least distance between two objects in any scene, by their names."""
        names = [pose.name for pose in self.demonstrations[0].objects]
        return {
            (one, other): min(float(np.linalg.norm(_way_m(scene, one, other))) for scene in self.demonstrations)
            for one, other in product(names, repeat=2)
        }


def path_m(start: EndEffectorAction | None, actions: Sequence[EndEffectorAction]) -> Array:
    """Return (P, 3) the successive positions of the hand."""
    poses = actions if start is None else (start, *actions)
    return np.array([pose.position_m for pose in poses])


def distances_m(path_m: Array, place_m: Array) -> Array:
    """Return (P,) the distance of a place from each segment of a path; the first is that from its start."""
    before_m = np.concatenate([path_m[:1], path_m[:-1]])
    gone_m, to_place_m = path_m - before_m, place_m - before_m
    squared = np.maximum(np.einsum("pk,pk->p", gone_m, gone_m), 1e-12)
    share = np.clip(np.einsum("pk,pk->p", to_place_m, gone_m) / squared, 0, 1)
    distances: Array = np.linalg.norm(to_place_m - share[:, None] * gone_m, axis=1)
    return distances


def _by_role(scene: Query) -> Mapping[str, ObjectPose]:
    """Return the objects by name, and those that the instruction mentions also by their role, as `<0>`."""
    poses = {pose.name: pose for pose in scene.objects}
    return poses | {scene.order.placeholder(name): poses[name] for name in scene.order.objects}


def _rigid(
    one: str, other: str, scenes: Sequence[Mapping[str, ObjectPose]], tilted: frozenset[str]
) -> RigidPair | None:
    """Return the pair seen from the object and in the frame in which it varies least; None if it varies.

    In many demonstrations it may vary along one of the horizontal axes of an object, and be constant along the other.
    """
    if all(poses[one] is poses[other] for poses in scenes):
        return None
    pairs = []
    for (seen, origin), frame in [(order, f) for order in permutations((one, other)) for f in OBJECT_FRAMES]:
        anchor = Anchor(origin, frame, tilted=tilted)
        seen_m = [_seen_m(poses[seen], poses[origin], anchor) for poses in scenes]
        pairs.append(RigidPair(seen, origin, anchor, Range.of(seen_m)))
    pair = min(pairs, key=lambda pair: float(pair.seen_m.width.max()))
    if pair.seen_m.width.max() < FIXED_M:
        return pair
    if len(scenes) < MANY:
        return None
    turning = [pair for pair in pairs if pair.anchor.place_turns and _turns([poses[pair.other] for poses in scenes])]
    along = [replace(pair, axes=(axis,)) for pair in turning for axis in (0, 1)]
    found = [pair for pair in along if pair.seen_m.width[pair.axes[0]] < FIXED_M]
    return min(found, key=lambda pair: float(pair.seen_m.width[pair.axes[0]]), default=None)


def _turns(poses: Sequence[ObjectPose]) -> bool:
    known = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
    turned_deg = [math.degrees(quaternions.angle_between_rad(known[0], each)) for each in known]
    return len(known) == len(poses) and max(turned_deg) > TURNED_DEG


def _seen_m(one: ObjectPose, other: ObjectPose, anchor: Anchor) -> Array:
    """Return (3,) the position of one object in the anchor's frame at the other."""
    return quaternions.rotated(quaternions.inverse(anchor.axes_of(other)), one.position_m - other.position_m)


def _way_m(scene: Query, one: str, other: str) -> Array:
    way_m: Array = scene.object(one).position_m - scene.object(other).position_m
    return way_m


def arrangement_findings(query: Query, scenes: ShownScenes, followed: frozenset[str]) -> Iterator[Finding]:
    """Yield a finding for the rigid pair that is farthest from its arrangement, and one for a pair on the wrong side.

    Args:
        followed: the objects that rows of the requested motion are relative to; their arrangement counts first.
    """
    poses = _by_role(query)
    names = {key: pose.name for key, pose in poses.items()}
    off: list[tuple[Rule, RigidPair, float]] = []
    for pair in scenes.pairs:
        follows = not followed.isdisjoint(names.get(key, key) for key in (pair.one, pair.other))
        off.append((ARRANGEMENT_OF_FOLLOWED if follows else ARRANGEMENT, pair, pair.off_m(poses)))
    found = [item for item in off if item[0].severity(item[2]) is not None]
    if found:
        rule, pair, off_m = max(found, key=lambda item: (item[0] is ARRANGEMENT_OF_FOLLOWED, item[2]))
        one, other = names[pair.one], names[pair.other]
        message = (
            f"{one} is {100 * off_m:.1f} cm from its place relative to {other}{pair.along}, which is the same in every"
            " demonstration. Check that neither is taken for another object, and put them together as demonstrated."
        )
        yield rule.finding(message, f"objects[{one}]", {"off_m": off_m}, value=off_m)
    matter = followed.union(query.order.objects)
    for side in scenes.sides:
        off_m = -side.sign * float(_way_m(query, side.one, side.other)[side.axis])
        if not matter.isdisjoint((side.one, side.other)) and ARRANGEMENT_OF_SIDES.severity(off_m) is not None:
            message = (
                f"{side.one} is {100 * off_m:.1f} cm on the wrong side of {side.other} along {'xy'[side.axis]}: in"
                " every demonstration it is on the other side. Check that neither is taken for the other."
            )
            yield ARRANGEMENT_OF_SIDES.finding(message, f"objects[{side.one}]", {"off_m": off_m}, value=off_m)
            return
