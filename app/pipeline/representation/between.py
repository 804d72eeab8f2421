"""Chooses what the hand's place follows between two objects: half-way from one to the other, or another tenth of it."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchors import Anchor, Anchors, Frame, certain_share, deciding, relative_action
from app.pipeline.representation.axis_choice import rows_around
from roboprompt_client.types.arrays import Array

MIN_BETWEEN = 4  # demonstrations, as the tenth is fitted too
TENTHS = np.arange(1, 10)
CLOSE_M = 0.01  # largest scatter (rms) of a place that follows two objects


def between(
    group: Sequence[Demonstration], chosen: Sequence[Anchors], columns: Sequence[Sequence[str]], tilted: frozenset[str]
) -> list[Anchors]:
    """Return the anchors, with a place between two objects where the gripper switches and follows no single one.

    Demonstrations must scatter by `CLOSE_M` or more in the plane from every object, the world and the row's own origin,
    and from a place between two objects by a share of it that is small beyond chance. The rows around follow that place
    as well.

    Args:
        columns: of each object its name in every demonstration.
    """
    found = list(chosen)
    if len(group) < MIN_BETWEEN or len(columns) < 2:
        return found
    hands_m = np.array([[action.position_m for action in d.actions] for d in group])  # (N, K, 3)
    objects_m = np.array([[d.object(n).position_m for d, n in zip(group, names, strict=True)] for names in columns])
    origins_m = np.array([np.zeros_like(objects_m[0]), *objects_m])
    share = certain_share(len(group) - 1, 1)
    for k in group[0].switches:
        own_m = np.array([relative_action(d, k, a, tilted)[0] for d, a in zip(group, chosen[k], strict=True)])
        least_m = min(_plane_m(own_m), float(np.linalg.norm(_scatter_m(hands_m[:, k] - origins_m).min(axis=0)[:2])))
        if least_m < CLOSE_M:
            continue
        pair = _pair(hands_m[:, k], objects_m)
        if _plane_m(_seen_m(hands_m[:, k], objects_m, pair)) > min(CLOSE_M, share * least_m):
            continue
        for row in rows_around(hands_m, k):
            found[row] = _anchors(found[row], hands_m[:, row], objects_m, columns, pair)
    return found


def _seen_m(hands_m: Array, objects_m: Array, pair: tuple[int, int, int]) -> Array:
    """Return (N, 3) where hands are, seen from so many tenths of the way from one object to another."""
    one, other, tenths = pair
    seen_m: Array = hands_m - objects_m[one] - tenths / 10 * (objects_m[other] - objects_m[one])
    return seen_m


def _pair(hands_m: Array, objects_m: Array) -> tuple[int, int, int]:
    """Return two objects, and the tenth of the way from one to the other, from which hands scatter least."""
    pairs = [(one, other, int(t)) for one, other in combinations(range(len(objects_m)), 2) for t in TENTHS]
    return min(pairs, key=lambda pair: _plane_m(_seen_m(hands_m, objects_m, pair)))


def _anchors(
    own: Anchors, hands_m: Array, objects_m: Array, columns: Sequence[Sequence[str]], pair: tuple[int, int, int]
) -> Anchors:
    """Return the anchors between two objects; the hand's rotation follows one of them, or the world.

    The height is that of the place between, of the first object or of the world, whichever scatters less.
    """
    one, other, tenths = pair
    names = tuple(anchor.object_name for anchor in own)
    if own[0].hand_turns and names == tuple(columns[other]):
        one, other, tenths = other, one, 10 - tenths
    frame: Frame = "wo" if own[0].hand_turns and names == tuple(columns[one]) else "w"
    if own[0].hand_turns and frame == "w":
        return own
    heights_m = [_scatter_m(seen_m)[2] for seen_m in (_seen_m(hands_m, objects_m, (one, other, tenths)), hands_m)]
    world = heights_m[1] < heights_m[0] / 2
    return tuple(
        Anchor(name, frame, ((0, to), (1, to), (2, "" if world else to)), tenths)
        for name, to in zip(columns[one], columns[other], strict=True)
    )


def _plane_m(seen_m: Array) -> float:
    """Return the horizontal scatter of (N, 3)."""
    return float(np.linalg.norm(_scatter_m(seen_m)[:2]))


def _scatter_m(seen_m: Array) -> Array:
    """Return the scatter (..., 3) of (..., N, 3): rms from the median; of many, without the farthest fifth."""
    off_m = np.sort(np.abs(seen_m - np.median(seen_m, axis=-2, keepdims=True)), axis=-2)
    kept_m = off_m[..., : deciding(seen_m.shape[-2]), :]
    scatter_m: Array = np.sqrt((kept_m**2).mean(axis=-2))
    return scatter_m
