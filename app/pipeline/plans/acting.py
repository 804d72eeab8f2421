"""Which rows of a plan are acts: the hand, or what it holds, does something to an object there."""

from collections.abc import Sequence

import numpy as np

from app.pipeline.plans.rows import PlanRow, of_a_way
from app.pipeline.thresholds import GRASPED_M
from roboprompt_client.types.arrays import Array

CLOSER = 0.5  # share of a row's scatter below which a later row is clearly more consistent
LOW_M = 0.03  # a path with a smaller range of heights has no lowest row
LOWEST_M = 0.01  # rows within this of the lowest count as lowest
TURNS_BACK = -0.5  # cosine of the angle between coming and going
LEG_M = 0.02  # shorter motions have no direction
TILTED_DEG = 30.0  # a hand that turns by more and turns back pours
ASIDE_M = 0.06  # horizontal distance from a grasp within which an object is only lifted


def acting_rows(plan: Sequence[PlanRow]) -> list[int]:
    """Return the rows in which the hand acts on something, itself or with the held object."""
    return sorted({*touching_rows(plan), *_carried_rows(plan)})


def touching_rows(plan: Sequence[PlanRow]) -> list[int]:
    """Return the rows in which the hand itself acts on something.

    These are the rows in which the gripper switches; without any, as when a button is pressed, those in which the hand
    is lowest or reverses; without these every row.
    """
    return switching_rows(plan) or _tips(plan) or list(range(len(plan)))


def slides_on(plan: Sequence[PlanRow], k: int) -> bool:
    """Return whether the hand slides through row `k`: low there and in the next, with no gripper switch or reversal."""
    if k + 1 == len(plan) or switching_rows(plan) or (k > 0 and plan[k - 1].grippers != plan[k].grippers):
        return False
    tips = _tips(plan)
    stays_low = k + 1 in tips or plan[k + 1].height_m < plan[k].height_m + LOW_M
    return k in tips and stays_low and not (k > 0 and _goes_back(plan, k))


def leads_on(plan: Sequence[PlanRow], k: int) -> bool:
    """Return whether the hand slides on to a place at the same object that is clearly more consistent."""
    here, after = plan[k], plan[k + 1] if k + 1 < len(plan) else plan[k]
    return slides_on(plan, k) and after.anchors == here.anchors and after.scatter_m < CLOSER * here.scatter_m


def _carried_rows(plan: Sequence[PlanRow]) -> list[int]:
    """Return the rows in which the hand acts with the held object, as with a cup, a hammer or a sponge.

    There it reverses (and is not merely lifted), or turns and turns back; with an object that is never released also
    where it is lowest.
    """
    switches = switching_rows(plan)
    found: set[int] = set()
    for grasp in (k for k in switches if not plan[k].gripper_open):
        release = next((k for k in switches if k > grasp), None)
        held = [k for k in range(grasp + 1, release or len(plan)) if _aside_m(plan[k], plan[grasp]) > ASIDE_M]
        found.update(k for k in held if k + 1 < len(plan) and (_strikes(plan, k) or _tilts(plan, k)))
        if release is None and held:
            lowest_m = min(plan[k].height_m for k in held)
            found.update(k for k in held if plan[k].height_m <= min(lowest_m + LOWEST_M, plan[-1].height_m - LOW_M))
    return sorted(found)


def turn_off_deg(plan: Sequence[PlanRow], k: int) -> float:
    """Return how much the turn to row `k` differs from the median in more than a third of the demonstrations."""
    turned_deg = _turned_deg(plan[k - 1], plan[k])
    return of_a_way(np.abs(turned_deg - np.median(turned_deg)))


def _turned_deg(one: PlanRow, other: PlanRow) -> Array:
    turned: Array = np.degrees((one.hands.inv() * other.hands).magnitude())
    return turned


def _aside_m(one: PlanRow, other: PlanRow) -> float:
    return float(np.median(np.linalg.norm((one.positions_m - other.positions_m)[:, :2], axis=1)))


def _strikes(plan: Sequence[PlanRow], k: int) -> bool:
    """Return whether the hand reverses in row `k`, and is not merely lifted."""
    return _goes_back(plan, k) and plan[k].height_m < max(plan[j].height_m for j in (k - 1, k + 1)) + LOW_M


def _tilts(plan: Sequence[PlanRow], k: int) -> bool:
    """Return whether the hand turns towards row `k` and turns back after it."""
    before, here, after = plan[k - 1 : k + 2]
    least_deg = float(np.median([_turned_deg(before, here), _turned_deg(here, after)], axis=1).min())
    return least_deg > TILTED_DEG and float(np.median(_turned_deg(before, after))) < least_deg


def _goes_back(plan: Sequence[PlanRow], k: int) -> bool:
    coming_m, going_m = (plan[j + 1].positions_m - plan[j].positions_m for j in (k - 1, k))
    lengths_m = np.linalg.norm(coming_m, axis=1) * np.linalg.norm(going_m, axis=1)
    cosines = np.einsum("nx,nx->n", coming_m, going_m) / np.maximum(lengths_m, LEG_M**2)
    return float(np.median(cosines)) < TURNS_BACK


def switching_rows(plan: Sequence[PlanRow]) -> list[int]:
    """Return the rows in which the gripper acts.

    A person may also close an empty hand on the way. Such a switch is the only one, away from objects, and a later row
    is clearly more consistent; it does not count.
    """
    switches = [k for k in range(1, len(plan)) if plan[k - 1].grippers != plan[k].grippers]
    if len(switches) > 1:
        return switches
    return [
        k
        for k in switches
        if _at_object(plan[k]) or not any(row.scatter_m < CLOSER * plan[k].scatter_m for row in plan[k + 1 :])
    ]


def _at_object(row: PlanRow) -> bool:
    away_m = np.linalg.norm(row.offsets_m, axis=1)
    return bool(row.anchors[0].object_name) and float(np.median(away_m)) <= GRASPED_M


def _tips(plan: Sequence[PlanRow]) -> list[int]:
    """Return the rows in which the hand is lowest, and those in which it reverses.

    A reversal before a lowest row that is clearly more consistent does not count.
    """
    if not plan:
        return []
    heights_m = np.array([row.height_m for row in plan])
    level = np.ptp(heights_m) < LOW_M
    lowest = [] if level else np.flatnonzero(heights_m <= heights_m.min() + LOWEST_M).tolist()
    turns = [k for k in range(1, len(plan) - 1) if _goes_back(plan, k)]
    kept_m = {k: min((plan[j].scatter_m for j in lowest if j > k), default=np.inf) for k in turns}
    return sorted({*lowest, *(k for k in turns if kept_m[k] >= CLOSER * plan[k].scatter_m)})
