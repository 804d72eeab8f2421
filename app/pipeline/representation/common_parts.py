"""Finds the parts that demonstrations share: a few consecutive actions at one object that several of them show.

A part is relative to an object and may be carried out at any object of the same kind: a grasp of the green block also
grasps the red one. Each action is assigned to the object relative to which most demonstrations agree on it; consecutive
actions at one object are a part if enough demonstrations contain them.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, groupby
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.order.lexicon import noun_of, phrase_of
from app.pipeline.representation.anchors import MIXED_FRAMES, OBJECT_FRAMES, Anchor, Frame, relative_poses
from app.pipeline.representation.object_rows import OFFSET_UNIT_M
from app.pipeline.workspace import rotation_bins
from roboprompt_client.types.arrays import Array

ALIKE_M, ALIKE_DEG = 0.015, 10.0  # tolerances within which two actions are the same
ENOUGH = 3  # demonstrations that must contain a part (or all, if there are fewer): two may agree by chance
MENTIONED = 2.0  # weight of an object that the instruction mentions
MIXED = 0.5  # weight of the frames `ow` and `wo`: most demonstrations must contradict the others


class PartRow(NamedTuple):
    """An action relative to an object, in integers: offset in units of 5 mm, rotation in bins of 5 degrees."""

    frame: Frame
    numbers: tuple[int, ...]
    gripper_open: bool


class Part(NamedTuple):
    """Actions at one object.

    Attributes:
        word: its name in replies: grasp, release or reach, numbered if there are several.
        kind: the noun of the objects that it was demonstrated at.
    """

    word: str
    kind: str
    rows: tuple[PartRow, ...]


class Step(NamedTuple):
    """A part at an object."""

    part: Part
    object_name: str

    @property
    def text(self) -> str:
        """The step as it stands in replies."""
        return f"{self.part.word} {self.object_name}"


def kind_of(name: str) -> str:
    """Return the noun of an object's name: block for `red block`."""
    return noun_of(phrase_of(name))


def find_steps(demonstrations: Sequence[Demonstration], tilted: frozenset[str]) -> list[tuple[Step, ...] | None]:
    """Return each demonstration as steps; None for one with actions that too few others share.

    Args:
        tilted: objects whose frame `o` is their full rotation.
    """
    candidates = [_candidates(demonstration, tilted) for demonstration in demonstrations]
    _count(candidates)
    described = map(_described, demonstrations, candidates)
    pieces = [_pieces(number, seen) for number, seen in enumerate(described)]
    clusters = _clusters([piece for own in pieces for piece in own])
    needed = min(ENOUGH, len(demonstrations))
    parts = _named([cluster for cluster in clusters if len({piece.demonstration for piece in cluster}) >= needed])
    return [_steps(own, parts) for own in pieces]


@dataclass(eq=False)
class _Seen:
    """One action of a demonstration relative to one of its objects; `count` demonstrations agree on it."""

    anchor: Anchor
    offset_m: Array
    rotation_xyzw: Array
    gripper_open: bool
    count: int = 0


@dataclass(frozen=True, eq=False)
class _Piece:
    """Actions of one demonstration that follow each other at one object; `was_open` is the gripper before them."""

    demonstration: int
    seen: tuple[_Seen, ...]
    was_open: bool

    @property
    def form(self) -> tuple[object, ...]:
        """Equal for pieces that may be one part."""
        kind = kind_of(self.seen[0].anchor.object_name)
        return kind, self.was_open, *((seen.anchor.frame, seen.gripper_open) for seen in self.seen)

    def alike(self, other: "_Piece") -> bool:
        """Return whether all actions of another piece of the same form are the same within tolerances."""
        return all(map(_alike, self.seen, other.seen))


_LEAST_COSINE = math.cos(math.radians(ALIKE_DEG / 2))  # of quaternions, which turn by half the angle


def _alike(one: _Seen, other: _Seen) -> bool:
    off_m = float(np.linalg.norm(one.offset_m - other.offset_m))
    return off_m <= ALIKE_M and abs(float(one.rotation_xyzw @ other.rotation_xyzw)) >= _LEAST_COSINE


def _described(demonstration: Demonstration, candidates: Sequence[Sequence[_Seen]]) -> list[_Seen]:
    """Return the actions of a demonstration, each relative to the object on which most demonstrations agree.

    Args:
        candidates: [action][candidate], counted.
    """
    chosen: list[_Seen] = []
    for row in candidates:
        before = chosen[-1].anchor if chosen else None
        chosen.append(max(row, key=partial(_merit, mentioned=demonstration.order.objects, before=before)))
    return chosen


def _merit(seen: _Seen, mentioned: Sequence[str], before: Anchor | None) -> tuple[float, bool, float]:
    """Return the rank of a candidate: weighted count, then the same anchor as the action before, then nearness."""
    share = MENTIONED if seen.anchor.object_name in mentioned else 1.0
    share *= MIXED if seen.anchor.frame in MIXED_FRAMES else 1.0
    return share * seen.count, seen.anchor == before, -float(np.linalg.norm(seen.offset_m))


def _candidates(demonstration: Demonstration, tilted: frozenset[str]) -> list[list[_Seen]]:
    """Return [action][candidate]: each action relative to each object in each of its frames."""
    by_anchor = {}
    for pose in demonstration.objects:
        for frame in (*OBJECT_FRAMES, *MIXED_FRAMES) if pose.quaternion_xyzw is not None else OBJECT_FRAMES[:1]:
            offsets_m, rotations = relative_poses(demonstration, Anchor(pose.name, frame), tilted)
            by_anchor[Anchor(pose.name, frame)] = offsets_m, rotations.as_quat().reshape(-1, 4)
    return [
        [_Seen(anchor, offsets[k], turned[k], action.gripper_open) for anchor, (offsets, turned) in by_anchor.items()]
        for k, action in enumerate(demonstration.actions)
    ]


def _count(candidates: Sequence[Sequence[Sequence[_Seen]]]) -> None:
    """Set each candidate's `count`: how many demonstrations have the same action at an object of the same kind.

    Args:
        candidates: [demonstration][action][candidate].
    """
    comparable: dict[tuple[str, str, bool], list[tuple[int, _Seen]]] = defaultdict(list)
    for number, rows in enumerate(candidates):
        for seen in chain.from_iterable(rows):
            key = kind_of(seen.anchor.object_name), seen.anchor.frame, seen.gripper_open
            comparable[key].append((number, seen))
    for group in comparable.values():
        numbers = np.array([number for number, _ in group])
        offsets_m = np.array([seen.offset_m for _, seen in group])
        turned = np.array([seen.rotation_xyzw for _, seen in group])
        for _, seen in group:
            near = np.linalg.norm(offsets_m - seen.offset_m, axis=1) <= ALIKE_M
            near &= np.abs(turned @ seen.rotation_xyzw) >= _LEAST_COSINE
            seen.count = len(np.unique(numbers[near]))


def _pieces(number: int, described: Sequence[_Seen]) -> list[_Piece]:
    pieces = []
    is_open = described[0].gripper_open if described else True
    for _, seen in groupby(described, key=lambda seen: seen.anchor.object_name):
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


def _named(clusters: Sequence[Sequence[_Piece]]) -> dict[_Piece, Part]:
    """Return the part of each piece."""
    words = [_word(cluster[0]) for cluster in clusters]
    several, used = Counter(words), Counter[str]()
    parts: dict[_Piece, Part] = {}
    for word, cluster in zip(words, clusters, strict=True):
        used[word] += 1
        name = f"{word} {used[word]}" if several[word] > 1 else word
        kind = kind_of(cluster[0].seen[0].anchor.object_name)
        rows = tuple(_row([piece.seen[k] for piece in cluster]) for k in range(len(cluster[0].seen)))
        parts |= dict.fromkeys(cluster, Part(name, kind, rows))
    return parts


def _word(piece: _Piece) -> str:
    is_open = piece.seen[-1].gripper_open
    if piece.was_open == is_open:
        return "reach"
    return "release" if is_open else "grasp"


def _row(seen: Sequence[_Seen]) -> PartRow:
    """Return the median offset and mean rotation of several demonstrations as one row."""
    offset = np.rint(np.median([item.offset_m for item in seen], axis=0) / OFFSET_UNIT_M).astype(int)
    rotation = Rotation.from_quat([item.rotation_xyzw for item in seen]).mean()
    return PartRow(seen[0].anchor.frame, (*offset.tolist(), *rotation_bins(rotation)), seen[0].gripper_open)


def _steps(pieces: Sequence[_Piece], parts: Mapping[_Piece, Part]) -> tuple[Step, ...] | None:
    if not all(piece in parts for piece in pieces):
        return None
    return tuple(Step(parts[piece], piece.seen[0].anchor.object_name) for piece in pieces)
