"""Rows of one plan over its demonstrations: what each follows, where it lies around, and how far it scatters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.plans.recording import GRASPED_M
from app.pipeline.representation.anchor_choice import choose_anchors
from app.pipeline.representation.anchors import M_PER_RAD, Anchors, relative_action, tilted_objects
from roboprompt_client.types.arrays import Array

HUBER = 1.5  # in robust standard deviations: what is farther from the center counts less
ITERATIONS = 5
MAD_TO_SIGMA = 1.4826  # of a normal distribution
PRECISE_M = 0.002
TOLERANCE_SHARE = 0.9  # the share of the demonstrations that lie within a row's tolerance
MARGIN_M = 0.03  # beyond the farthest demonstration, within which an action is supported
MARGIN_DEG = 20.0
BEYOND_NOISE_M = 0.08  # twice what rows scatter by where the noise of poses is twice the paper's
CLOSER = 0.5  # times the scatter of a row, from which on a later one keeps to something
WAY_SHARE = 1 / 3  # of the demonstrations: what more of them do is a way of doing it, not a slip
LOW_M = 0.03  # a way that is as level has no lowest place
LOWEST_M = 0.01  # above the lowest place a hand is there
TURNS_BACK = -0.5  # cosine of the angle between coming and going
LEG_M = 0.02  # shorter ways have no direction
TILTED_DEG = 30.0  # a hand that turns by more than this and turns back pours
ASIDE_M = 0.06  # from where something was grasped: nearer it is only lifted


@dataclass(frozen=True, eq=False)
class PlanRow:
    """One action of a plan.

    Attributes:
        anchors: what it is relative to, in each demonstration.
        offsets_m: (N, 3) relative to the anchors, along their axes.
        rotations: N, from the anchors' axes.
        center_m: (3,) the robust center of the offsets.
        mean_rotation: of the rotations.
        gripper_open: what the gripper does there in most.
        grippers: everything that it does there.
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
    def mean_xyzw(self) -> Array:
        """(4,) the mean rotation as a quaternion."""
        mean: Array = self.mean_rotation.as_quat(canonical=True)
        return mean

    @cached_property
    def off_m(self) -> Array:
        """(N,) distances of the demonstrations' offsets from the center."""
        off: Array = np.linalg.norm(self.offsets_m - self.center_m, axis=1)
        return off

    @cached_property
    def scatter_m(self) -> float:
        """How far the median demonstration is from the center."""
        return float(np.median(self.off_m))

    @cached_property
    def way_off_m(self) -> float:
        """How far from the center more than a third of the demonstrations are at least: they do it another way."""
        return _of_a_way(self.off_m)

    @property
    def unturned(self) -> "PlanRow":
        """The row as if it did not matter how the hand is turned."""
        as_it_is = Rotation.identity()
        return replace(self, rotations=Rotation.concatenate([as_it_is] * len(self.anchors)), mean_rotation=as_it_is)

    @property
    def center_off_m(self) -> float:
        """How far the center is likely to be from that of very many demonstrations."""
        return self.scatter_m / math.sqrt(len(self.off_m))

    @cached_property
    def tolerance(self) -> tuple[float, float]:
        """Within how many meters and degrees of the center most demonstrations lie."""
        return float(np.quantile(self.off_m, TOLERANCE_SHARE)), float(np.quantile(self.off_deg, TOLERANCE_SHARE))

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Within how many meters and degrees of the center an action is supported."""
        return float(self.off_m.max()) + MARGIN_M, float(self.off_deg.max()) + MARGIN_DEG

    @cached_property
    def off_deg(self) -> Array:
        """(N,) angles of the demonstrations' rotations from their mean."""
        off: Array = np.degrees((self.mean_rotation.inv() * self.rotations).magnitude())
        return off


def _of_a_way(off: Array) -> float:
    """What more than a third of some distances are at least."""
    return float(np.sort(off)[-1 - int(WAY_SHARE * len(off))])


def plan_rows(
    group: Sequence[Demonstration], written: Sequence[Demonstration] = (), *, beyond_objects: bool = True
) -> tuple[PlanRow, ...]:
    """The rows of demonstrations that have equally many actions and do the same.

    Args:
        written: the same as a prompt shows them, which then decide what each row is relative to.
    """
    tilted = tilted_objects(group)
    chosen = choose_anchors(written or group, tilted, beyond_objects=beyond_objects)
    return tuple(_row(group, k, anchors, tilted) for k, anchors in enumerate(chosen))


def _row(group: Sequence[Demonstration], k: int, anchors: Anchors, tilted: frozenset[str]) -> PlanRow:
    relative = [relative_action(d, k, anchor, tilted) for d, anchor in zip(group, anchors, strict=True)]
    offsets_m = np.array([offset_m for offset_m, _ in relative])
    rotations = Rotation.concatenate([rotation for _, rotation in relative])
    center_m, mean = robust_center(offsets_m, rotations)
    states = [demonstration.actions[k].gripper_open for demonstration in group]
    is_open = 2 * sum(states) >= len(states)
    positions_m = np.array([demonstration.actions[k].position_m for demonstration in group])
    hands = Rotation.from_quat([demonstration.actions[k].quaternion_xyzw for demonstration in group])
    return PlanRow(anchors, offsets_m, rotations, center_m, mean, is_open, frozenset(states), positions_m, hands)


def robust_center(offsets_m: Array, rotations: Rotation) -> tuple[Array, Rotation]:
    """The center of poses with normal scatter and a few odd ones: Huber's estimate from the median.

    Args:
        offsets_m: (N, 3).
        rotations: N.
    """
    center_m: Array = np.median(offsets_m, axis=0)
    quaternions = rotations.as_quat()
    apart_rad = 2 * np.arccos(np.clip(np.abs(quaternions @ quaternions.T), 0, 1))
    mean = rotations[int(apart_rad.sum(axis=1).argmin())]  # the medoid
    for _ in range(ITERATIONS):
        off_m = np.linalg.norm(offsets_m - center_m, axis=1) + M_PER_RAD * (mean.inv() * rotations).magnitude()
        sigma_m = max(MAD_TO_SIGMA * float(np.median(off_m)), PRECISE_M)
        weights = np.minimum(1.0, HUBER * sigma_m / np.maximum(off_m, 1e-12))
        center_m = weights @ offsets_m / weights.sum()
        mean = rotations.mean(weights)
    return center_m, mean


def acting_rows(plan: Sequence[PlanRow]) -> list[int]:
    """The rows in which the hand acts on something, itself or with what it holds."""
    return sorted({*touching_rows(plan), *_carried_rows(plan)})


def touching_rows(plan: Sequence[PlanRow]) -> list[int]:
    """The rows in which the hand itself acts on something.

    Where the gripper switches; where none does, as when a button is pressed, where the hand is lowest or turns back;
    every row of a way that has nothing of the kind.
    """
    return _switches(plan) or _tips(plan) or list(range(len(plan)))


def _carried_rows(plan: Sequence[PlanRow]) -> list[int]:
    """The rows in which the hand does something with what it holds, as with a cup, a hammer or a sponge.

    Where it goes back where it came from, though not down again, or turns and turns back; of what it never lets go also
    where that is lowest.
    """
    switches = _switches(plan)
    found: set[int] = set()
    for grasp in (k for k in switches if not plan[k].gripper_open):
        release = next((k for k in switches if k > grasp), None)
        held = [k for k in range(grasp + 1, release or len(plan)) if _aside_m(plan[k], plan[grasp]) > ASIDE_M]
        found.update(k for k in held if k + 1 < len(plan) and (_strikes(plan, k) or _tilts(plan, k)))
        if release is None and held:
            lowest_m = min(_height_m(plan[k]) for k in held)
            found.update(k for k in held if _height_m(plan[k]) <= min(lowest_m + LOWEST_M, _height_m(plan[-1]) - LOW_M))
    return sorted(found)


def turn_off_deg(plan: Sequence[PlanRow], k: int) -> float:
    """How much more or less than in the median demonstration the hand turns to row `k` in more than a third of them."""
    turned_deg = _turned_deg(plan[k - 1], plan[k])
    return _of_a_way(np.abs(turned_deg - np.median(turned_deg)))


def _turned_deg(one: PlanRow, other: PlanRow) -> Array:
    turned: Array = np.degrees((one.hands.inv() * other.hands).magnitude())
    return turned


def _aside_m(one: PlanRow, other: PlanRow) -> float:
    return float(np.median(np.linalg.norm((one.positions_m - other.positions_m)[:, :2], axis=1)))


def _height_m(row: PlanRow) -> float:
    return float(np.median(row.positions_m[:, 2]))


def _strikes(plan: Sequence[PlanRow], k: int) -> bool:
    """Whether the hand comes from where it goes next, and is not merely lifted here."""
    return _goes_back(plan, k) and _height_m(plan[k]) < max(_height_m(plan[j]) for j in (k - 1, k + 1)) + LOW_M


def _tilts(plan: Sequence[PlanRow], k: int) -> bool:
    """Whether the hand is turned here otherwise than before, and turns back afterwards."""
    before, here, after = plan[k - 1 : k + 2]
    least_deg = float(np.median([_turned_deg(before, here), _turned_deg(here, after)], axis=1).min())
    return least_deg > TILTED_DEG and float(np.median(_turned_deg(before, after))) < least_deg


def _goes_back(plan: Sequence[PlanRow], k: int) -> bool:
    """Whether the hand comes from where it goes next."""
    coming_m, going_m = (plan[j + 1].positions_m - plan[j].positions_m for j in (k - 1, k))
    lengths_m = np.linalg.norm(coming_m, axis=1) * np.linalg.norm(going_m, axis=1)
    cosines = np.einsum("nx,nx->n", coming_m, going_m) / np.maximum(lengths_m, LEG_M**2)
    return float(np.median(cosines)) < TURNS_BACK


def _switches(plan: Sequence[PlanRow]) -> list[int]:
    """Return the rows in which the gripper acts.

    People also close an empty hand on the way, wherever it is: then it switches only once, away from objects, and comes
    later to something that it keeps to more closely.
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
    """The rows in which the hand is lowest, and those in which it goes back where it came from.

    Not where it goes back on the way to a lowest place that it keeps to more closely.
    """
    if not plan:
        return []
    heights_m = np.array([_height_m(row) for row in plan])
    level = np.ptp(heights_m) < LOW_M
    lowest = [] if level else np.flatnonzero(heights_m <= heights_m.min() + LOWEST_M).tolist()
    turns = [k for k in range(1, len(plan) - 1) if _goes_back(plan, k)]
    kept_m = {k: min((plan[j].scatter_m for j in lowest if j > k), default=np.inf) for k in turns}
    return sorted({*lowest, *(k for k in turns if kept_m[k] >= CLOSER * plan[k].scatter_m)})
