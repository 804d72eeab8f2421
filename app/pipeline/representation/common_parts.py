"""Finds the parts that demonstrations share: a few consecutive actions at one object that several of them show.

Each action is described relative to the object that explains it in most demonstrations; consecutive actions at one
object are a part if enough demonstrations have them, at any object of the same kind. A part that lies beside its object
may be shown on several sides: a release 18 cm to the left and one 18 cm to the right are the same on two sides. It can
be had on each side on which some part of its kind was shown.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain, groupby, product
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, Query
from app.pipeline.order.lexicon import noun_of, phrase_of
from app.pipeline.representation.anchors import MIXED_FRAMES, OBJECT_FRAMES, Anchor, Frame, anchor_pose, relative_poses
from app.pipeline.representation.carried import Scene, scenes_before
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

ALIKE_M, ALIKE_DEG = 0.015, 10.0  # tolerances within which two actions are the same
ENOUGH = 3  # demonstrations that must contain a part (or all, if there are fewer): two may agree by chance
# Weights of an explanation, times the number of demonstrations that agree with it
MENTIONED = 2.0  # by an object that the instruction mentions
MIXED = 0.5  # by the frames `ow` and `wo`: most demonstrations must contradict the others
CHANGED = 0.9  # by an object that the hand has moved, or the hand's rotation before: only where they explain more
SIDES = (("behind", "", "ahead"), ("right", "", "left"))  # of an object along x and y: on its -, 0 and + side
_LEAST_COSINE = math.cos(math.radians(ALIKE_DEG / 2))  # of quaternions, which turn by half the angle


Sides = tuple[int, int]  # +1 or -1 along x and along y, 0 for a part over the object's middle


class Spot(NamedTuple):
    """What an action is relative to.

    Attributes:
        was: the place that the object had at first; otherwise where it is now.
        keeps: the hand's rotation is relative to the one before: what it holds keeps its turn.
    """

    object_name: str
    was: bool
    frame: Frame
    keeps: bool


class PartRow(NamedTuple):
    """An action relative to a spot: offset (3,) in meters and rotation (4,)."""

    frame: Frame
    keeps: bool
    offset_m: Array
    rotation_xyzw: Array
    gripper_open: bool


@dataclass(frozen=True, eq=False)
class Part:
    """What the hand does at one object: it grasps it, releases something at it, or reaches for it.

    Attributes:
        words: its name in replies: grasp, release 2, release 18 cm left of.
        kind: the noun of the objects that it can be carried out at.
        was: it is carried out where the object was at first.
    """

    words: str
    kind: str
    was: bool
    rows: tuple[PartRow, ...]

    def text(self, object_name: str) -> str:
        """The part at an object as it stands in replies."""
        return f"{self.words} where {object_name} was" if self.was else f"{self.words} {object_name}"

    def placed(self, object_name: str, scene: Scene, first: Query, tilted: frozenset[str]) -> Iterator[EndEffectorAction]:
        """Yield its actions in a scene; `first` is the scene as it was observed."""
        at = first if self.was else Query("", scene.objects)
        hand = scene.hand
        for row in self.rows:
            pose = anchor_pose(Anchor(object_name, row.frame), at, tilted)
            if row.keeps:
                assert hand is not None
                pose = pose._replace(hand_axes=Rotation.from_quat(hand.quaternion_xyzw))
            position_m, rotation = pose.placed(row.offset_m, Rotation.from_quat(row.rotation_xyzw))
            hand = EndEffectorAction(position_m, rotation.as_quat(canonical=True), row.gripper_open)
            yield hand


@dataclass(frozen=True)
class Step:
    """A part at an object."""

    part: Part
    object_name: str

    @property
    def text(self) -> str:
        """The step as it stands in replies."""
        return self.part.text(self.object_name)


def kind_of(name: str) -> str:
    """Return the noun of an object's name: block for `red block`."""
    return noun_of(phrase_of(name))


def find_steps(
    demonstrations: Sequence[Demonstration], tilted: frozenset[str]
) -> tuple[list[tuple[Step, ...] | None], tuple[Part, ...]]:
    """Return each demonstration as steps, None for one with actions that too few others share; and all parts.

    Args:
        tilted: objects whose frame `o` is their full rotation.
    """
    candidates = [_candidates(demonstration, tilted) for demonstration in demonstrations]
    _count(candidates)
    described = map(_described, demonstrations, candidates)
    pieces = [_pieces(number, seen) for number, seen in enumerate(described)]
    clusters = _clusters([piece for own in pieces for piece in own])
    needed = min(ENOUGH, len(demonstrations))
    common = [cluster for cluster in clusters if len({piece.demonstration for piece in cluster}) >= needed]
    parts = _named(common)
    part_of = {piece: parts[k, piece.sides] for k, cluster in enumerate(common) for piece in cluster}
    steps = [
        tuple(Step(part_of[piece], piece.seen[0].spot.object_name) for piece in own) if part_of.keys() >= set(own) else None
        for own in pieces
    ]
    return steps, tuple(parts.values())


@dataclass(eq=False)
class _Seen:
    """One action of a demonstration relative to a spot; `count` demonstrations agree on it."""

    spot: Spot
    offset_m: Array
    rotation_xyzw: Array
    gripper_open: bool
    weight: float
    count: int = 0

    @property
    def form(self) -> tuple[object, ...]:
        """Equal for actions that may be the same."""
        return kind_of(self.spot.object_name), *self.spot[1:], self.gripper_open


@dataclass(frozen=True, eq=False)
class _Piece:
    """Actions of one demonstration that follow each other at one object; `was_open` is the gripper before them."""

    demonstration: int
    seen: tuple[_Seen, ...]
    was_open: bool

    @property
    def form(self) -> tuple[object, ...]:
        """Equal for pieces that may be one part."""
        return self.was_open, *(seen.form for seen in self.seen)

    @property
    def word(self) -> str:
        is_open = self.seen[-1].gripper_open
        return "reach" if self.was_open == is_open else "release" if is_open else "grasp"

    @cached_property
    def away_m(self) -> tuple[float, float]:
        """How far it is from the object's middle along x and y: of the first action that is not above it."""
        x, y = ([seen.offset_m[axis] for seen in self.seen if abs(seen.offset_m[axis]) > ALIKE_M] for axis in (0, 1))
        return next(iter(x), 0.0), next(iter(y), 0.0)

    @property
    def sides(self) -> Sides:
        """The sign of `away_m`."""
        x, y = np.sign(self.away_m).astype(int).tolist()
        return x, y

    @cached_property
    def offsets_m(self) -> Array:
        """(K, 3), as if it were on the positive sides."""
        mirrored: Array = np.array([seen.offset_m for seen in self.seen]) * _mirror(self.sides)
        return mirrored

    def alike(self, other: "_Piece") -> bool:
        """Return whether all actions of another piece of the same form are the same within tolerances."""
        turned = zip(self.seen, other.seen, strict=True)
        off_m = np.linalg.norm(self.offsets_m - other.offsets_m, axis=1)
        return bool((off_m <= ALIKE_M).all()) and all(
            abs(float(one.rotation_xyzw @ another.rotation_xyzw)) >= _LEAST_COSINE for one, another in turned
        )


def _described(demonstration: Demonstration, candidates: Sequence[Sequence[_Seen]]) -> list[_Seen]:
    """Return the actions of a demonstration, each relative to the spot on which most demonstrations agree.

    Args:
        candidates: [action][candidate], counted.
    """
    chosen: list[_Seen] = []
    for row in candidates:
        before = chosen[-1].spot if chosen else None
        chosen.append(max(row, key=partial(_merit, mentioned=demonstration.order.objects, before=before)))
    return chosen


def _merit(seen: _Seen, mentioned: Sequence[str], before: Spot | None) -> tuple[float, bool, float]:
    """Return the rank of a candidate: weighted count, then the same spot as the action before, then nearness."""
    share = seen.weight * (MENTIONED if seen.spot.object_name in mentioned else 1.0)
    return share * seen.count, seen.spot == before, -round(float(np.linalg.norm(seen.offset_m)), 6)


def _candidates(demonstration: Demonstration, tilted: frozenset[str]) -> list[list[_Seen]]:
    """Return [action][candidate]: each action relative to each object, where it is and where it was, in each frame."""
    actions, scenes = demonstration.actions, scenes_before(demonstration)
    hands = Rotation.from_quat([action.quaternion_xyzw for action in actions])
    kept = (hands[:-1].inv() * hands[1:]).as_quat() if len(actions) > 1 else np.zeros((0, 4))
    found: list[list[_Seen]] = [[] for _ in actions]
    for objects, same in groupby(range(len(actions)), key=lambda k: scenes[k].objects):
        numbers = list(same)
        for pose, was, weight in _places(demonstration.objects, objects):
            at = replace(demonstration, objects=(pose,))
            for frame in (*OBJECT_FRAMES, *MIXED_FRAMES) if pose.quaternion_xyzw is not None else OBJECT_FRAMES[:1]:
                offsets_m, rotations = relative_poses(at, Anchor(pose.name, frame), tilted)
                turned = rotations.as_quat().reshape(-1, 4)
                weight_in = weight * (MIXED if frame in MIXED_FRAMES else 1.0)
                for k in numbers:
                    spot, is_open = Spot(pose.name, was, frame, keeps=False), actions[k].gripper_open
                    found[k].append(_Seen(spot, offsets_m[k], turned[k], is_open, weight_in))
                    if k and frame in OBJECT_FRAMES:
                        spot = spot._replace(keeps=True)
                        found[k].append(_Seen(spot, offsets_m[k], kept[k - 1], is_open, weight_in * CHANGED))
    return found


def _places(first: Sequence[ObjectPose], now: Sequence[ObjectPose]) -> Iterator[tuple[ObjectPose, bool, float]]:
    """Yield each object where it is, and if it has been moved, where it was; and the weight of that."""
    for before, pose in zip(first, now, strict=True):
        yield pose, False, 1.0 if pose is before else CHANGED
        if pose is not before:
            yield before, True, CHANGED


def _count(candidates: Sequence[Sequence[Sequence[_Seen]]]) -> None:
    """Set each candidate's `count`: how many demonstrations have the same action at an object of the same kind.

    Args:
        candidates: [demonstration][action][candidate].
    """
    comparable: dict[tuple[object, ...], list[tuple[int, _Seen]]] = defaultdict(list)
    for number, rows in enumerate(candidates):
        for seen in chain.from_iterable(rows):
            comparable[seen.form].append((number, seen))
    for group in comparable.values():
        numbers = np.array([number for number, _ in group])
        offsets_m = _one_sided([seen.offset_m for _, seen in group])
        turned = np.array([seen.rotation_xyzw for _, seen in group])
        for (_, seen), offset_m in zip(group, offsets_m, strict=True):
            near = np.linalg.norm(offsets_m - offset_m, axis=1) <= ALIKE_M
            near &= np.abs(turned @ seen.rotation_xyzw) >= _LEAST_COSINE
            seen.count = len(np.unique(numbers[near]))


def _one_sided(offsets_m: Sequence[Array]) -> Array:
    """Return offsets (N, 3) without their signs along x and y."""
    found: Array = np.array(offsets_m)
    found[:, :2] = np.abs(found[:, :2])
    return found


def _pieces(number: int, described: Sequence[_Seen]) -> list[_Piece]:
    pieces = []
    is_open = described[0].gripper_open if described else True
    for _, seen in groupby(described, key=lambda seen: seen.spot[:2]):
        pieces.append(_Piece(number, tuple(seen), is_open))
        is_open = pieces[-1].seen[-1].gripper_open
    return pieces


def _clusters(pieces: Sequence[_Piece]) -> list[list[_Piece]]:
    """Return clusters of pieces that are the same, in the order of their first occurrence."""
    clusters: list[list[_Piece]] = []
    by_form: dict[tuple[object, ...], list[list[_Piece]]] = defaultdict(list)
    for piece in pieces:
        found = next((cluster for cluster in by_form[piece.form] if cluster[0].alike(piece)), None)
        if found is None:
            found = []
            clusters.append(found)
            by_form[piece.form].append(found)
        found.append(piece)
    return clusters


def _named(clusters: Sequence[Sequence[_Piece]]) -> dict[tuple[int, Sides], Part]:
    """Return the parts: each cluster on the sides that are shown of its family, by the cluster's number and side."""
    families: dict[tuple[str, str, bool], list[int]] = defaultdict(list)
    for k, cluster in enumerate(clusters):
        spot = cluster[0].seen[0].spot
        families[cluster[0].word, kind_of(spot.object_name), spot.was].append(k)
    parts: dict[tuple[int, Sides], Part] = {}
    for (word, kind, was), members in families.items():
        shown = [{piece.sides[axis] for k in members for piece in clusters[k]} for axis in (0, 1)]
        had = [(k, sides) for k in members for sides in _sides(clusters[k][0].sides, shown)]
        where = [_where(clusters[k][0].away_m, sides) if len(had) > 1 else "" for k, sides in had]
        numbers = Counter[str]()
        for (k, sides), at in zip(had, where, strict=True):
            numbers[at] += 1
            number = f" {numbers[at]}" if where.count(at) > 1 else ""
            parts[k, sides] = Part(f"{word}{number}{at}", kind, was, _rows(clusters[k], sides))
    return parts


def _sides(own: Sides, shown: Sequence[set[int]]) -> list[Sides]:
    """Return the sides on which a part can be had: on each axis those that are shown, if it is beside its object."""
    x, y = (sorted(sides - {0}, reverse=True) if side else [0] for side, sides in zip(own, shown, strict=True))
    return list(product(x, y))


def _where(away_m: tuple[float, float], sides: Sides) -> str:
    """Return a place in words: " 4 cm ahead and 6 cm left of"."""
    said = [f"{100 * abs(m):.0f} cm {SIDES[axis][1 + sides[axis]]}" for axis, m in enumerate(away_m) if m]
    return f" {' and '.join(said)} of" if said else ""


def _mirror(sides: Sides) -> Array:
    """Return the factors (3,) that mirror offsets between the positive sides and these."""
    return np.array([*(side or 1 for side in sides), 1])


def _rows(cluster: Sequence[_Piece], sides: Sides) -> tuple[PartRow, ...]:
    """Return the median offset and mean rotation of each action over a cluster, on these sides."""
    offsets_m = np.median([piece.offsets_m for piece in cluster], axis=0) * _mirror(sides)
    rows = []
    for k, seen in enumerate(cluster[0].seen):
        turned = Rotation.from_quat([piece.seen[k].rotation_xyzw for piece in cluster]).mean()
        rows.append(PartRow(seen.spot.frame, seen.spot.keeps, offsets_m[k], turned.as_quat(), seen.gripper_open))
    return tuple(rows)
