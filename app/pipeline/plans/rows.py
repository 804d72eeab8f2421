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
from app.pipeline.thresholds import M_PER_RAD, WAY_SHARE
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


def plan_rows(group: Sequence[Demonstration], written: Sequence[Demonstration] = ()) -> tuple[PlanRow, ...]:
    """Return the rows of demonstrations of one plan, which have equally many actions.

    Args:
        written: the same as a prompt shows them, which then decide the anchors.
    """
    chosen = choose_anchors(written or group, tilted_objects(group), beyond_objects=True)
    return tuple(plan_row(group, k, anchors) for k, anchors in enumerate(chosen))


def plan_row(group: Sequence[Demonstration], k: int, anchors: Anchors) -> PlanRow:
    """Return the row of the actions `k`, relative to these anchors, one for each demonstration."""
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


def left_out_errors_m(inputs: Array, offsets_m: Array) -> Array:
    """Return (N, 3) the leave-one-out errors of a linear regression from inputs (N, D) to offsets (N, 3)."""
    design = np.concatenate([np.ones((len(inputs), 1)), inputs], axis=1)
    hat = design @ np.linalg.pinv(design)
    errors_m: Array = (offsets_m - hat @ offsets_m) / np.maximum(1 - np.diag(hat), 1e-6)[:, None]
    return errors_m


def left_out_m(inputs: Array, offsets_m: Array) -> float:
    """Return the median length of the leave-one-out errors."""
    return float(np.median(np.linalg.norm(left_out_errors_m(inputs, offsets_m), axis=1)))
