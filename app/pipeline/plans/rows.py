"""Rows of one plan: the anchor, the robust mean and the scatter of each action over the plan's demonstrations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchor_choice import choose_anchors
from app.pipeline.representation.anchors import Anchors, anchor_poses, hand_poses, tilted_objects
from app.pipeline.thresholds import GRASPED_M, M_PER_RAD, WAY_SHARE
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array

HUBER = 1.5  # in robust standard deviations: residuals beyond it get less weight
ITERATIONS = 5
MAX_AVERAGED_RAD = math.radians(60)
MAD_TO_SIGMA = 1.4826  # of a normal distribution
PRECISE_M = 0.002
TOLERANCE_SHARE = 0.9  # the share of the demonstrations that lie within a row's tolerance
MARGIN_M = 0.03  # beyond the farthest demonstration, within which an action is supported
MARGIN_DEG = 20.0
CLOSER = 0.5  # share of a row's scatter below which a later row is clearly more consistent
LOW_M = 0.03  # a path with a smaller range of heights has no lowest row
LOWEST_M = 0.01  # rows within this of the lowest count as lowest
TURNS_BACK = -0.5  # cosine of the angle between coming and going
LEG_M = 0.02  # shorter motions have no direction
TILTED_DEG = 30.0  # a hand that turns by more and turns back pours
ASIDE_M = 0.06  # horizontal distance from a grasp within which an object is only lifted


@dataclass(frozen=True, eq=False)
class PlanRow:
    """One action of a plan.

    Attributes:
        anchors: the anchor of each demonstration.
        offsets_m: (N, 3) relative to the anchors, along their axes.
        rotations: N, from the anchors' axes.
        center_m: (3,) the robust center of the offsets.
        mean_rotation: of the rotations.
        gripper_open: what the gripper does there in most.
        grippers: all states that the gripper has there.
        positions_m: (N, 3) of the hand in the world frame.
        hands: N, its rotations there.
    """

    anchors: Anchors
    offsets_m: Array
    rotations: Rotation
    center_m: Array
    mean_rotation: Rotation
    gripper_open: bool
    grippers: frozenset[bool]
    positions_m: Array
    hands: Rotation

    @cached_property
    def off_m(self) -> Array:
        """(N,) distances of the demonstrations' offsets from the center."""
        off: Array = np.linalg.norm(self.offsets_m - self.center_m, axis=1)
        return off

    @cached_property
    def scatter_m(self) -> float:
        """The median distance of the demonstrations from the center."""
        return float(np.median(self.off_m))

    @cached_property
    def height_m(self) -> float:
        """The median height of the hand in the world frame."""
        return float(np.median(self.positions_m[:, 2]))

    @cached_property
    def way_off_m(self) -> float:
        """The distance from the center that more than a third of the demonstrations exceed, as in two ways."""
        return of_a_way(self.off_m)

    @property
    def unturned(self) -> "PlanRow":
        """The row with the hand's rotations ignored."""
        as_it_is = Rotation.identity()
        return replace(self, rotations=Rotation.concatenate([as_it_is] * len(self.anchors)), mean_rotation=as_it_is)

    @property
    def center_off_m(self) -> float:
        """The standard error of the center."""
        return self.scatter_m / math.sqrt(len(self.off_m))

    @cached_property
    def tolerance(self) -> tuple[float, float]:
        """The distances from the center, in meters and degrees, within which most demonstrations lie."""
        return float(np.quantile(self.off_m, TOLERANCE_SHARE)), float(np.quantile(self.off_deg, TOLERANCE_SHARE))

    @cached_property
    def reach(self) -> tuple[float, float]:
        """The distances from the center, in meters and degrees, within which an action is supported."""
        return float(self.off_m.max()) + MARGIN_M, float(self.off_deg.max()) + MARGIN_DEG

    @cached_property
    def off_deg(self) -> Array:
        """(N,) angles of the demonstrations' rotations from their mean."""
        off: Array = np.degrees((self.mean_rotation.inv() * self.rotations).magnitude())
        return off


def of_a_way(off: Array) -> float:
    """Return the distance that more than a third of the distances (N,) reach."""
    return float(np.sort(off)[-1 - int(WAY_SHARE * len(off))])


def plan_rows(
    group: Sequence[Demonstration], written: Sequence[Demonstration] = (), *, beyond_objects: bool = True
) -> tuple[PlanRow, ...]:
    """Return the rows of demonstrations of one plan, which have equally many actions.

    Args:
        written: the same as a prompt shows them, which then decide the anchors.
    """
    chosen = choose_anchors(written or group, tilted_objects(group), beyond_objects=beyond_objects)
    return tuple(_row(group, k, anchors) for k, anchors in enumerate(chosen))


def _row(group: Sequence[Demonstration], k: int, anchors: Anchors) -> PlanRow:
    actions = [demonstration.actions[k] for demonstration in group]
    positions_m, hands = hand_poses(actions)
    offsets_m, rotations = anchor_poses(anchors, group).seen(positions_m, hands)
    center_m, mean = robust_center(offsets_m, rotations)
    states = [action.gripper_open for action in actions]
    is_open = 2 * sum(states) >= len(states)
    return PlanRow(anchors, offsets_m, rotations, center_m, mean, is_open, frozenset(states), positions_m, hands)


def robust_center(offsets_m: Array, rotations: Rotation) -> tuple[Array, Rotation]:
    """Return the robust mean of poses with outliers: Huber's estimate, which starts at the median.

    Rotations of a minority that are far from those of most have no part in the mean, which would be like neither.

    Args:
        offsets_m: (N, 3).
        rotations: N.
    """
    center_m: Array = np.median(offsets_m, axis=0)
    hands = rotations.as_quat()
    apart_rad = quaternions.angles_rad(hands[:, None], hands)
    medoid = int(apart_rad.sum(axis=1).argmin())
    mean, alike = hands[medoid], apart_rad[medoid] <= MAX_AVERAGED_RAD
    if 2 * alike.sum() <= len(alike):
        alike[:] = True
    for _ in range(ITERATIONS):
        off_m = np.linalg.norm(offsets_m - center_m, axis=1) + M_PER_RAD * quaternions.angles_rad(mean, hands)
        sigma_m = max(MAD_TO_SIGMA * float(np.median(off_m)), PRECISE_M)
        weights = np.minimum(1.0, HUBER * sigma_m / np.maximum(off_m, 1e-12))
        center_m = weights @ offsets_m / weights.sum()
        mean = np.linalg.eigh((weights * alike * hands.T) @ hands)[1][:, -1]  # Markley et al. 2007, eq. 12
    return center_m, Rotation.from_quat(mean)


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
    """Return whether the hand is low in row `k` and the next, without a switch of the gripper or a reversal in `k`."""
    tips = [] if switching_rows(plan) else _tips(plan)
    return k in tips and k + 1 in tips and not (k > 0 and _goes_back(plan, k))


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
    """Return whether the hand reverses its direction in row `k`."""
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
    """Return whether most hands are near enough to grasp the object that the row follows."""
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
