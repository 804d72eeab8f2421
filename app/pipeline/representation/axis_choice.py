"""Chooses what the hand's place follows along single axes, and what its rotation follows instead of the place's object.

It may be at a height of the world above an object, have x of one object and y of another, or move along a rail. What
it lets go of at one object may stay turned as it was taken, and be held beside its middle, as by a handle.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchors import (
    MIN_TURNED,
    SERVES_M,
    START,
    WORLD,
    Anchor,
    Anchors,
    Frame,
    certain_share,
    deciding,
    poses_scatter_m,
    relative_poses,
)
from app.pipeline.thresholds import TURNED_M
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

CONTRADICTED_M = 0.01  # least scatter (rms) along an axis that something else must explain
EQUAL_M = 0.002  # scatters that differ by less are equal
AROUND_M = 0.06  # horizontal distance from a place within which the hand comes and goes
WORLD_REACH_M = 4.9  # the largest coordinate that a row of a prompt can hold
UNTURNED: Mapping[Frame, Frame] = {"o": "wo", "ow": "w"}


def by_axis(
    group: Sequence[Demonstration], chosen: Sequence[Anchors], columns: Sequence[Sequence[str]], tilted: frozenset[str]
) -> list[Anchors]:
    """Return the anchors, with other origins along the axes where demonstrations contradict the row's own.

    At least three demonstrations must scatter by `CONTRADICTED_M` or more along the axis seen from the row's own
    origin, and seen from another by a share that is small beyond chance (`certain_share`). All axes must then scatter
    within `SERVES_M`. A hand that closes does so at the height of what it takes; heights that vary were misread. Rows
    around one in which a hand lets go of what it holds beside its middle follow the same place.

    Args:
        columns: of each object its name in every demonstration.
    """
    if len(group) < MIN_TURNED or not group[0].actions:
        return list(chosen)
    hands_m = np.array([[action.position_m for action in d.actions] for d in group])  # (N, K, 3)
    near = np.abs(hands_m).max() < WORLD_REACH_M
    origins = [*([("",) * len(group)] if near else []), *map(tuple, columns)]
    places_m = np.array([[_place_m(d, name) for d, name in zip(group, names, strict=True)] for names in origins])
    scatters_m = np.array([_scatter_m(hands_m - origin_m[:, None]) for origin_m in places_m])  # (M, K, 3)
    own_m = {anchors: _own_scatter_m(group, anchors, tilted) for anchors in set(chosen)}
    share = certain_share(len(group), 1)
    turns_m = {names: _turns_m(group, names, tilted) for names in origins}
    found = []
    for k, anchors in enumerate(chosen):
        if (own_m[anchors][k] >= CONTRADICTED_M).any() and _names(anchors) in origins:
            followed = _followed(scatters_m[:, k], own_m[anchors][k], origins.index(_names(anchors)), share)
            if _closes(group[0].actions, k):
                followed[2] = origins.index(_names(anchors))
            anchors = _along(anchors, [origins[place] for place in followed], tilted)
        found.append(_turned_with(group, k, anchors, {names: off_m[k] for names, off_m in turns_m.items()}, tilted))
    for k in group[0].switches:
        if found[k][0].frame == "o" and len(found[k][0].along) == len("xyz"):
            for row in rows_around(hands_m, k):
                found[row] = found[k]
    return found


def rows_around(hands_m: Array, k: int) -> npt.NDArray[np.intp]:
    """Return the rows in which the hand comes to the place of row `k`, or goes from it, in all demonstrations.

    Args:
        hands_m: (N, K, 3).
    """
    away_m = np.linalg.norm((hands_m - hands_m[:, k : k + 1])[..., :2], axis=2)
    return np.flatnonzero(away_m.max(axis=0) <= AROUND_M)


def _turns_m(group: Sequence[Demonstration], names: Sequence[str], tilted: frozenset[str]) -> Array:
    """Return the scatter (K,) of the hand's rotations seen from the objects, by `M_PER_RAD`; from "" in the world."""
    if any(name and d.object(name).quaternion_xyzw is None for d, name in zip(group, names, strict=True)):
        return np.full(len(group[0].actions), np.inf)
    anchors = tuple(Anchor(name, "wo") if name else WORLD for name in names)
    turns_m: Array = poses_scatter_m(group, anchors, tilted)[1]
    return turns_m


def _turned_with(
    group: Sequence[Demonstration],
    k: int,
    anchors: Anchors,
    turns_m: Mapping[tuple[str, ...], float],
    tilted: frozenset[str],
) -> Anchors:
    """Return the anchors with the hand's rotation relative to another object that it turns with, as what it holds does.

    Its place turns about a third one, too, where it holds the object beside its middle, as by a handle. Demonstrations
    must contradict the row's own rotations and places, as they must its own place along an axis.

    Args:
        turns_m: the scatter of the hand's rotations, seen from each object or the world.
    """
    own, share = _names(anchors), certain_share(len(group), 1)
    own_m = turns_m.get(own if anchors[0].hand_turns else ("",) * len(own), 0.0)
    objects = [names for names in turns_m if all(names)]
    best = min(objects, key=turns_m.__getitem__, default=own)
    if anchors[0].place_turns or anchors[0].tenths < 10 or anchors[0] == START or own_m < CONTRADICTED_M:
        return anchors
    if turns_m.get(best, own_m) >= min(share * own_m, SERVES_M):
        return anchors
    if best != own:
        anchors = tuple(
            Anchor(name, "wo", tuple((axis, dict(anchor.along).get(axis, anchor.object_name)) for axis in range(3)))
            for name, anchor in zip(best, anchors, strict=True)
        )
    off_m = _off_m(group, k, anchors, tilted)
    if turns_m[best] >= TURNED_M or off_m < CONTRADICTED_M:
        return anchors
    about = (
        tuple(Anchor(name, "o", ((0, at), (1, at), (2, at))) for name, at in zip(best, names, strict=True))
        for names in objects
        if names != best
    )
    aside = min(about, key=lambda each: _off_m(group, k, each, tilted), default=anchors)
    return aside if _off_m(group, k, aside, tilted) < min(share * off_m, TURNED_M) else anchors


def _off_m(group: Sequence[Demonstration], k: int, anchors: Anchors, tilted: frozenset[str]) -> float:
    """Return the largest scatter of the hand's place in row `k` along an axis."""
    return float(_own_scatter_m(group, anchors, tilted)[k].max())


def _closes(actions: Sequence[EndEffectorAction], k: int) -> bool:
    """Return whether the hand closes at row `k`, or is closed in the first one, as where it acts alone is compared."""
    return not actions[k].gripper_open and (k == 0 or actions[k - 1].gripper_open)


def _names(anchors: Anchors) -> tuple[str, ...]:
    return tuple(anchor.frame if anchor == START else anchor.object_name for anchor in anchors)


def _place_m(demonstration: Demonstration, name: str) -> Array:
    return demonstration.object(name).position_m if name else np.zeros(3)


def _own_scatter_m(group: Sequence[Demonstration], anchors: Anchors, tilted: frozenset[str]) -> Array:
    """Return the scatter (K, 3) relative to the anchors; of axes that turn with an object the larger for both."""
    relative_m = np.array([relative_poses(d, anchor, tilted)[0] for d, anchor in zip(group, anchors, strict=True)])
    scatter_m = _scatter_m(relative_m)
    if anchors[0].place_turns:
        scatter_m[:, :2] = scatter_m[:, :2].max(axis=1, keepdims=True)
    return scatter_m


def _scatter_m(offsets_m: Array) -> Array:
    """Return the scatter (K, 3) of offsets (N, K, 3): rms from the median; of many, without the farthest fifth."""
    off_m = np.sort(np.abs(offsets_m - np.median(offsets_m, axis=0)), axis=0)[: deciding(len(offsets_m))]
    scatter_m: Array = np.sqrt((off_m**2).mean(axis=0))
    return scatter_m


def _followed(scatters_m: Array, own_m: Array, own: int, share: float) -> list[int]:
    """Return the origin of each axis: as few different ones as explain the row.

    Args:
        scatters_m: (M, 3) along the world's axes, seen from each origin; the world is the first.
        own_m: (3,) as the row has it.
        own: the row's origin.
    """
    best, left_m = [own] * 3, own_m.copy()
    for axis, seen_m in enumerate(scatters_m.T):
        if own_m[axis] >= CONTRADICTED_M and seen_m.min() < share * own_m[axis]:
            best[axis] = int(np.flatnonzero(seen_m <= seen_m.min() + EQUAL_M)[0])
            left_m[axis] = seen_m.min()
    if left_m.max() >= SERVES_M:  # still not explained, as on the way from the start to an object
        return [own] * 3
    others = [place for place in best if place != own]
    for axis in range(3) if len(set(others)) > 1 else ():
        equal = [place for place in others if scatters_m[place, axis] <= own_m[axis] + EQUAL_M]
        if best[axis] == own and equal:
            best[axis] = equal[0]
    return best


def _along(anchors: Anchors, followed: Sequence[tuple[str, ...]], tilted: frozenset[str]) -> Anchors:
    """Return the anchors with these origins along the world's axes, each with its name in every demonstration."""
    frame, own = anchors[0].frame, _names(anchors)
    aside = followed[0] != own or followed[1] != own
    if not aside and (followed[2] == own or (anchors[0].place_turns and not tilted.isdisjoint(own))):
        return anchors
    if anchors[0].place_turns and aside:
        frame = UNTURNED[frame]
    if not anchors[0].hand_turns:  # the row then needs no rotation of the object that it names first
        objects = [names for names in followed if any(names)]
        own = max(objects, key=objects.count)
        frame = "w"
    return tuple(
        Anchor(name, frame, tuple((axis, names[k]) for axis, names in enumerate(followed) if names != own))
        for k, name in enumerate(own)
    )
