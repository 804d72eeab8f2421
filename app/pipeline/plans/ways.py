"""Ways of one plan: demonstrations that scatter around two values, and a single one whose hand is turned otherwise."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.plans.rows import PlanRow, plan_rows
from app.pipeline.representation.anchors import relative_row
from app.pipeline.thresholds import M_PER_RAD

TWO_WAYS_M = 0.04  # clusters that are less far apart are one way
GAP = 4.0  # between two clusters, in standard deviations within them
GAP_OF_FEW = 10.0  # the same of fewer than MANY_DEMONSTRATIONS demonstrations, which more often lie apart by chance
MANY_DEMONSTRATIONS = 6
FEWEST_OF_A_WAY = 2
SHARE_OF_A_WAY = 0.3
FEWEST_OF_A_LONE = 4  # demonstrations; of three, two may agree by chance
LONE_DEG = 60.0  # a rotation that is farther from all others is an outlier,
AGREE_DEG = 20.0  # if the others are within this of their mean


def other_way(group: Sequence[Demonstration]) -> list[int]:
    """Return the indices of demonstrations that do it in another way than the others; empty if there is one way."""
    if (lone := lone_way(group)) is not None:
        return [lone]
    ways = next((ways for row in plan_rows(group) if (ways := two_ways(row)) is not None), ())
    return np.flatnonzero(ways).tolist()


def two_ways(row: PlanRow, gap_of_few: float = GAP_OF_FEW, least_m: float = TWO_WAYS_M) -> np.ndarray | None:
    """Return (N,) bool, which of two clusters each demonstration is in; None if there is one cluster.

    The poses are projected onto their first principal component. Two clusters leave a gap there that is wide compared
    with the standard deviation on either side of it.
    """
    turns_m = M_PER_RAD * (row.mean_rotation.inv() * row.rotations).as_rotvec()
    poses_m = np.concatenate([row.offsets_m - row.center_m, turns_m], axis=1)
    fewest = max(FEWEST_OF_A_WAY, math.ceil(SHARE_OF_A_WAY * len(poses_m)))
    if len(poses_m) < 2 * fewest:
        return None
    _, _, directions = np.linalg.svd(poses_m - poses_m.mean(axis=0), full_matrices=False)
    places_m = poses_m @ directions[0]
    order = np.argsort(places_m, kind="stable")
    sorted_m = places_m[order]
    gaps_m = np.diff(sorted_m)[fewest - 1 : len(sorted_m) - fewest]
    cut = int(np.argmax(gaps_m)) + fewest
    low, high = sorted_m[:cut], sorted_m[cut:]
    within_m = float(np.sqrt((low.var() * len(low) + high.var() * len(high)) / len(sorted_m)))
    if gaps_m.max() < max(least_m, (GAP if len(poses_m) >= MANY_DEMONSTRATIONS else gap_of_few) * within_m):
        return None
    other = np.zeros(len(places_m), dtype=bool)
    other[order[cut:]] = True
    return other


def lone_way(group: Sequence[Demonstration]) -> int | None:
    """Return the index of the one demonstration whose hand is turned otherwise where the gripper switches, or None.

    Args:
        group: demonstrations of one plan, with equally many actions.
    """
    if len(group) < FEWEST_OF_A_LONE or not group[0].actions:
        return None
    acting = sorted({k for demonstration in group for k in demonstration.switches})
    candidates = {place for k in acting if (place := _odd(group, k)) is not None}
    return next((place for place in sorted(candidates) if _is_alone(group, place, acting)), None)


def _odd(group: Sequence[Demonstration], k: int) -> int | None:
    """Return the index of the hand that is turned farthest from the others in row `k`; None within `LONE_DEG`."""
    hands = Rotation.from_quat([demonstration.actions[k].quaternion_xyzw for demonstration in group])
    apart_deg = np.degrees([(hand.inv() * hands).magnitude() for hand in hands])
    np.fill_diagonal(apart_deg, np.inf)
    place = int(apart_deg.min(axis=1).argmax())
    return place if apart_deg[place].min() > LONE_DEG else None


def _is_alone(group: Sequence[Demonstration], place: int, acting: Sequence[int]) -> bool:
    """Return whether the others' rotations agree in an acting row and this demonstration's is far from their mean."""
    others = [demonstration for k, demonstration in enumerate(group) if k != place]
    rows = plan_rows(others)
    return any(
        float(rows[k].off_deg.max()) <= AGREE_DEG and _turned_deg(group[place], k, rows[k]) > LONE_DEG for k in acting
    )


def _turned_deg(demonstration: Demonstration, k: int, row: PlanRow) -> float:
    _, hands = relative_row([demonstration], k, row.anchors[:1])
    return float(np.degrees((row.mean_rotation.inv() * hands[0]).magnitude()))
