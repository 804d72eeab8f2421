"""Chooses anchors whose axes point from one object to another, as where a hand pushes one thing to the other."""

import math
from collections.abc import Sequence
from itertools import permutations

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchor_scatter import (
    CONTRADICTED_M,
    MIN_SCATTERED,
    SERVES_M,
    axes_scatter_m,
    central_scatter_m,
    certain_share,
    hands_at,
    poses_scatter_m,
)
from app.pipeline.representation.anchors import START, AnchorFrame, Anchors, anchor_poses
from app.pipeline.thresholds import TURNED_M
from roboprompt_client.types.arrays import Array

FRAMES: tuple[AnchorFrame, ...] = ("ow", "o")  # the direction turns the hand's place alone, or its rotation, too
# Least scatter (rms) that a direction must explain. Where a flowing hand closes, it is recorded up to 2 cm late, along
# its way to the next object; other anchors average that.
FAR_M = 0.03
MIN_APART_M = 0.05  # horizontally; of objects that are nearer, noise decides the direction
MAX_OBJECTS = 6  # the first by order of mention; of many things that lie about, two explain a row by chance


def toward_others(
    group: Sequence[Demonstration], chosen: Sequence[Anchors], objects: Sequence[Anchors]
) -> list[Anchors]:
    """Return the anchors; those of rows that follow the direction from one object to another have axes along it.

    At least three demonstrations must scatter by `FAR_M` or more in the plane, seen from the row's own anchor, and
    along that direction by a share that is small beyond chance. Heights and rotations must be explained, too. A hand
    that carries something straight from one object to the other is on that line anywhere: it follows no direction.

    Args:
        objects: that rows may follow, each in the frame `wo`.
    """
    found = list(chosen)
    if len(group) < MIN_SCATTERED or len(objects) < 2 or not found:
        return found
    scatter_m = {anchors: _scatter_m(group, anchors) for anchors in dict.fromkeys(chosen)}
    own_m = np.array([scatter_m[anchors][:, k] for k, anchors in enumerate(chosen)])
    rows = [
        k
        for k, anchors in enumerate(chosen)
        if own_m[k, 0] >= FAR_M and anchors[0] != START and not _carries(group[0], k)
    ]
    share = certain_share(len(group), 2)
    for k, (one, other) in _directions(group, objects, rows).items():
        place_m, turn_m, height_m = own_m[k]
        most_m = min(share * place_m, SERVES_M), max(turn_m, TURNED_M), max(height_m, CONTRADICTED_M)
        toward = [(anchors, _scatter_m(group, anchors)[:, k]) for anchors in _toward(one, other)]
        best, seen_m = min(toward, key=lambda each: float(each[1][1]))
        if (seen_m <= most_m).all():
            found[k] = best
    return found


def _carries(demonstration: Demonstration, k: int) -> bool:
    """Return whether the hand is closed before and after action `k`, and open some other time: it holds something."""
    opens = [action.gripper_open for action in demonstration.actions]
    return any(opens) and not any(opens[max(k - 1, 0) : k + 1])


def _directions(
    group: Sequence[Demonstration], objects: Sequence[Anchors], rows: Sequence[int]
) -> dict[int, tuple[Anchors, Anchors]]:
    """Return for each of these rows the two objects along whose direction its places scatter least in the plane.

    Only objects count that are apart in all demonstrations.
    """
    hands_m = _in_plane(hands_at(group)[:, rows])
    places_m = {anchors: _in_plane(anchor_poses(anchors, group).origin_m) for anchors in objects[:MAX_OBJECTS]}
    found: dict[int, tuple[Anchors, Anchors]] = {}
    least_m = dict.fromkeys(rows, math.inf)
    for one, other in permutations(places_m, 2) if rows else ():
        way_m = places_m[other] - places_m[one]
        if (length_m := np.abs(way_m)).min() >= MIN_APART_M:
            seen_m = (hands_m - places_m[one][:, None]) * np.conj(way_m / length_m)[:, None]  # turned back: (N, K)
            for k, off_m in zip(rows, central_scatter_m(np.abs(seen_m[:, None] - seen_m)).tolist(), strict=True):
                if off_m < least_m[k]:
                    least_m[k], found[k] = off_m, (one, other)
    return found


def _in_plane(positions_m: Array) -> npt.NDArray[np.complex128]:
    """Return the horizontal places of positions (..., 3) as x + iy, so that to turn them is to multiply them."""
    return np.asarray(positions_m[..., 0] + 1j * positions_m[..., 1])


def _toward(one: Anchors, other: Anchors) -> list[Anchors]:
    """Return the anchors at one object with axes toward the other, for the hand's place alone or its rotation, too."""
    return [
        tuple(at._replace(frame=frame, toward=to.object_name) for at, to in zip(one, other, strict=True))
        for frame in FRAMES
    ]


def _scatter_m(group: Sequence[Demonstration], anchors: Anchors) -> Array:
    """Return the scatter (3, K) of the hand seen from the anchors: in the plane, of its rotation, and of its height."""
    return np.array([*poses_scatter_m(group, anchors), axes_scatter_m(group, anchors)[:, 2]])
