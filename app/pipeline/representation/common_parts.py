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
from itertools import groupby, product
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, Query
from app.pipeline.representation.frame_text import CODES
from app.pipeline.representation.object_frame import tilted_objects
from app.pipeline.representation.part import Part, Spot, SpotAction, kind_of, scenes_before
from app.pipeline.skill import turns
from app.pipeline.skill.rows import seen_from
from app.pipeline.skill.scene import Scene
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

ALIKE_M, ALIKE_DEG = 0.015, 10.0  # tolerances within which two actions are the same
ENOUGH = 3  # demonstrations that must contain a part (or all, if there are fewer): two may agree by chance
# Weights of an explanation, times the number of demonstrations that agree with it
MENTIONED = 2.0  # by an object that the instruction mentions
MIXED = 0.5  # by the frames `ow` and `wo`: most demonstrations must contradict the others
MOVED = 0.9  # by an object that the hand has moved
BESIDE_M = 0.03  # from an object's middle; what is nearer has no side
SIDES = (("behind", "", "ahead of"), ("right of", "", "left of"))  # where a part is on the -, 0 and + side: along x, y
Sides = tuple[int, int]  # -1, 0 or 1 along x and along y; 0: not beside the object
_LEAST_COSINE = math.cos(math.radians(ALIKE_DEG / 2))  # of quaternions, which turn by half the angle


class CommonParts(NamedTuple):
    """What demonstrations share.

    Attributes:
        steps: the text of each step of each demonstration; None for one with actions that too few others have.
        parts: all that a reply may use.
    """

    steps: list[tuple[str, ...] | None]
    parts: tuple[Part, ...]


def find_parts(demonstrations: Sequence[Demonstration]) -> CommonParts:
    """Return the parts of demonstrations."""
    tilted = tilted_objects(demonstrations)
    candidates = [_candidates(demonstration, tilted) for demonstration in demonstrations]
    _count(candidates)
    pieces = [
        _pieces(number, _described(demonstration, candidates[number]))
        for number, demonstration in enumerate(demonstrations)
    ]
    needed = min(ENOUGH, len(demonstrations))
    clusters = _clusters([piece for own in pieces for piece in own])
    common = [cluster for cluster in clusters if len({piece.demonstration for piece in cluster}) >= needed]
    parts = _named(common)
    text = {p: parts[k, p.sides].text(p.spot.object_name) for k, cluster in enumerate(common) for p in cluster}
    steps = [tuple(text[piece] for piece in own) if all(piece in text for piece in own) else None for own in pieces]
    return CommonParts(steps, tuple(parts.values()))


@dataclass(eq=False)
class _Candidate:
    """One description of an action; `count` demonstrations agree with it."""

    action: SpotAction
    weight: float
    count: int = 0

    def merit(self, mentioned: Sequence[str], before: Spot | None) -> tuple[float, bool, float]:
        """Return its rank: weighted count, then the same spot as the action before, then nearness."""
        spot, away_m = self.action.spot, float(np.linalg.norm(self.action.offset_m))
        share = self.weight * (MENTIONED if spot.object_name in mentioned else 1.0)
        return share * self.count, spot == before, -round(away_m, 6)


@dataclass(frozen=True, eq=False)
class _Piece:
    """Actions of one demonstration that follow each other at one object; `was_open` is the gripper before them."""

    demonstration: int
    actions: tuple[SpotAction, ...]
    was_open: bool

    @property
    def spot(self) -> Spot:
        return self.actions[0].spot

    @property
    def form(self) -> tuple[object, ...]:
        """Equal for pieces that may be one part."""
        return self.was_open, *(action.form for action in self.actions)

    @property
    def word(self) -> str:
        is_open = self.actions[-1].gripper_open
        return "reach" if self.was_open == is_open else "release" if is_open else "grasp"

    @cached_property
    def beside_m(self) -> tuple[float, float]:
        """How far its first action that is beside the object is beside it, along x and along y; 0 if none is."""
        x, y = (
            next((a.offset_m[axis] for a in self.actions if abs(a.offset_m[axis]) > BESIDE_M), 0.0) for axis in (0, 1)
        )
        return x, y

    @property
    def sides(self) -> Sides:
        x, y = np.sign(self.beside_m).astype(int).tolist()
        return x, y

    @cached_property
    def offsets_m(self) -> Array:
        """(K, 3), mirrored to the positive sides."""
        mirrored: Array = np.array([action.offset_m for action in self.actions]) * _mirror(self.sides)
        return mirrored

    def alike(self, other: "_Piece") -> bool:
        """Return whether another piece of the same form is the same within tolerances, on whichever side."""
        off_m = np.linalg.norm(self.offsets_m - other.offsets_m, axis=1)
        turned = zip(self.actions, other.actions, strict=True)
        cosines = [abs(float(one.rotation_xyzw @ another.rotation_xyzw)) for one, another in turned]
        return bool(off_m.max() <= ALIKE_M) and min(cosines) >= _LEAST_COSINE


def _candidates(demonstration: Demonstration, tilted: frozenset[str]) -> list[list[_Candidate]]:
    """Return [action][candidate]: each action relative to each object, where it is and where it was, in each frame."""
    actions, scenes = demonstration.actions, scenes_before(demonstration)
    if not actions:
        return []
    hands = np.array([action.quaternion_xyzw for action in actions])
    kept = turns.product(turns.inverse(hands[:-1]), hands[1:])
    found: list[list[_Candidate]] = [[] for _ in actions]
    for objects, numbers in groupby(range(len(actions)), key=lambda k: scenes[k].objects):
        every = list(numbers)
        for pose, was, weight in _places(demonstration.objects, objects):
            scene = Scene.of(Query("", (pose,)))
            for code in CODES if pose.quaternion_xyzw is not None else CODES[:1]:
                spot = Spot(pose.name, code, pose.name in tilted, was, keeps=False)
                for k in every:
                    seen = SpotAction(spot, *seen_from(spot.frame, actions[k], scene), actions[k].gripper_open)
                    found[k].append(_Candidate(seen, weight * (1.0 if len(code) == 1 else MIXED)))
                    if k and len(code) == 1:
                        keeping = replace(seen, spot=spot._replace(keeps=True), rotation_xyzw=kept[k - 1])
                        found[k].append(_Candidate(keeping, weight))
    return found


def _places(observed: Sequence[ObjectPose], now: Sequence[ObjectPose]) -> Iterator[tuple[ObjectPose, bool, float]]:
    """Yield each object where it is and, if the hand has moved it, where it was; with the weight of that."""
    for before, pose in zip(observed, now, strict=True):
        yield pose, False, 1.0 if pose is before else MOVED
        if pose is not before:
            yield before, True, MOVED


def _count(candidates: Sequence[Sequence[Sequence[_Candidate]]]) -> None:
    """Set each `count`: how many demonstrations have the same action at an object of the same kind, on either side.

    Args:
        candidates: [demonstration][action][candidate].
    """
    comparable: dict[tuple[object, ...], list[tuple[int, _Candidate]]] = defaultdict(list)
    for number, rows in enumerate(candidates):
        for row in rows:
            for candidate in row:
                comparable[candidate.action.form].append((number, candidate))
    for group in comparable.values():
        numbers = np.array([number for number, _ in group])
        offsets_m = np.array([candidate.action.offset_m for _, candidate in group])
        beside = np.abs(offsets_m) > BESIDE_M
        beside[:, 2] = False
        offsets_m[beside] = np.abs(offsets_m[beside])
        turned = np.array([candidate.action.rotation_xyzw for _, candidate in group])
        for k, (_, candidate) in enumerate(group):
            near = np.linalg.norm(offsets_m - offsets_m[k], axis=1) <= ALIKE_M
            near &= np.abs(turned @ turned[k]) >= _LEAST_COSINE
            candidate.count = len(np.unique(numbers[near]))


def _described(demonstration: Demonstration, candidates: Sequence[Sequence[_Candidate]]) -> list[SpotAction]:
    """Return the best description of each action of a demonstration.

    The hand keeps its turn only where more demonstrations agree on that than on any other description.
    """
    chosen: list[SpotAction] = []
    for every in candidates:
        most = max(candidate.count for candidate in every if not candidate.action.spot.keeps)
        row = [candidate for candidate in every if not candidate.action.spot.keeps or candidate.count > most]
        before = chosen[-1].spot if chosen else None
        merit = partial(_Candidate.merit, mentioned=demonstration.order.objects, before=before)
        chosen.append(max(row, key=merit).action)
    return chosen


def _pieces(number: int, described: Sequence[SpotAction]) -> list[_Piece]:
    pieces: list[_Piece] = []
    for _, actions in groupby(described, key=lambda action: (action.spot.object_name, action.spot.was)):
        before = pieces[-1].actions[-1] if pieces else described[0]
        pieces.append(_Piece(number, tuple(actions), before.gripper_open))
    return pieces


def _clusters(pieces: Sequence[_Piece]) -> list[list[_Piece]]:
    clusters: list[list[_Piece]] = []
    for piece in pieces:
        for cluster in clusters:
            if cluster[0].form == piece.form and cluster[0].alike(piece):
                cluster.append(piece)
                break
        else:
            clusters.append([piece])
    return clusters


def _named(clusters: Sequence[Sequence[_Piece]]) -> dict[tuple[int, Sides], Part]:
    """Return the parts by number of their cluster and sides; those of one word and kind are on each other's sides.

    Their names say how far beside the object they are, or have a number, where that is needed to tell them apart.
    """
    families: dict[tuple[str, str, bool], list[int]] = defaultdict(list)
    for k, cluster in enumerate(clusters):
        families[cluster[0].word, kind_of(cluster[0].spot.object_name), cluster[0].spot.was].append(k)
    parts: dict[tuple[int, Sides], Part] = {}
    for (word, *_), members in families.items():
        shown = [{piece.sides[axis] for k in members for piece in clusters[k]} - {0} for axis in (0, 1)]
        found = [(k, sides) for k in members for sides in _sides(clusters[k][0].sides, shown)]
        places = [_place(clusters[k][0].beside_m, sides) for k, sides in found]
        if len(set(places)) == 1:  # it tells nothing apart
            places = [""] * len(places)
        numbers = Counter[str]()
        for (k, sides), place in zip(found, places, strict=True):
            numbers[place] += 1
            number = f" {numbers[place]}" if places.count(place) > 1 else ""
            parts[k, sides] = Part(f"{word}{number}{place}", _averaged(clusters[k], sides))
    return parts


def _sides(own: Sides, shown: Sequence[set[int]]) -> list[Sides]:
    """Return where a part can be had: along an axis on which it is beside its object on every side that is shown."""
    x, y = (sorted(sides, reverse=True) if side else [0] for side, sides in zip(own, shown, strict=True))
    return list(product(x, y))


def _place(beside_m: tuple[float, float], sides: Sides) -> str:
    """Return a place in words: " 3.5 cm ahead of and 6 cm left of"; the axes are those of the part's frame."""
    words = [f"{round(200 * abs(m)) / 2:g} cm {SIDES[axis][1 + sides[axis]]}" for axis, m in enumerate(beside_m) if m]
    return "".join(f" {word}" for word in " and ".join(words).split())


def _mirror(sides: Sides) -> Array:
    """Return the factors (3,) that mirror offsets between the positive sides and these."""
    return np.array([*(side or 1 for side in sides), 1])


def _averaged(cluster: Sequence[_Piece], sides: Sides) -> tuple[SpotAction, ...]:
    offsets_m = np.median([piece.offsets_m for piece in cluster], axis=0) * _mirror(sides)
    turned = [Rotation.from_quat([p.actions[k].rotation_xyzw for p in cluster]).mean() for k in range(len(offsets_m))]
    return tuple(
        replace(action, offset_m=offset_m, rotation_xyzw=rotation.as_quat())
        for action, offset_m, rotation in zip(cluster[0].actions, offsets_m, turned, strict=True)
    )
