"""A parallel gripper turned by half a turn about its approach grasps alike: which turn the demonstrated wrist had.

The approach is the hand's z axis, and the position of an action lies on it between the fingers.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.plans.support import PlacedPlan
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

HALF_TURN = np.array([0.0, 0.0, 1.0, 0.0])  # about z
DOWN = np.array([1.0, 0.0, 0.0, 0.0])  # wrist angles are counted from a hand that points down, x forward
ALONG_APPROACH = 0.7  # the cosine of 45 degrees: hands that come to their grasps so come along their z axis
CLEARLY_DEG = 1.0  # a turn must be better by this: nothing turns on rounding


def half_turned(action: EndEffectorAction) -> EndEffectorAction:
    """The action with the hand turned by 180 degrees about its approach."""
    return replace(action, quaternion_xyzw=quaternions.product(action.quaternion_xyzw, HALF_TURN))


def half_turned_plan(plan: PlacedPlan) -> PlacedPlan:
    """The plan with every hand turned so."""
    return tuple(replace(row, action=half_turned(row.action)) for row in plan)


class WristRange:
    """The wrist angles that demonstrations have: the twist of the hand about its approach.

    Args:
        base_m: (3,) of an arm whose first joint is vertical: angles are counted from the direction in which the hand is
            seen from there, as such an arm turns along; None: from the world's axes.

    Attributes:
        approaches: whether hands come to their grasps along their z axis; otherwise no turn is like another.
    """

    def __init__(self, demonstrations: Sequence[Demonstration], base_m: Array | None = None) -> None:
        self._base_m = base_m
        actions = [action for item in demonstrations for action in item.actions]
        angles = np.sort([self._angle_deg(action) % 360 for action in actions])
        gaps = np.diff(angles, append=angles[0] + 360)
        first = (int(gaps.argmax()) + 1) % len(angles)
        self._start_deg, self._width_deg = float(angles[first]), 360 - float(gaps.max())
        along = [cosine for item in demonstrations for cosine in _along_approach(item)]
        self.approaches = bool(along) and float(np.median(along)) >= ALONG_APPROACH

    def beyond_deg(self, actions: Iterable[EndEffectorAction]) -> float:
        """How far the farthest of some actions lies beyond the demonstrated angles; 0 within."""
        return max((self._beyond_deg(action) for action in actions), default=0.0)

    def _beyond_deg(self, action: EndEffectorAction) -> float:
        past_deg = (self._angle_deg(action) - self._start_deg) % 360 - self._width_deg
        return max(0.0, min(past_deg, 360 - self._width_deg - past_deg))

    def _angle_deg(self, action: EndEffectorAction) -> float:
        _, _, z, w = quaternions.product(quaternions.inverse(DOWN), action.quaternion_xyzw)
        twist_deg = math.degrees(2 * math.atan2(z, w))
        if self._base_m is None:
            return twist_deg
        away_m = action.position_m - self._base_m
        return twist_deg + math.degrees(math.atan2(away_m[1], away_m[0]))  # a hand that points down turns the other way


def _along_approach(demonstration: Demonstration) -> list[float]:
    """At each switch of the gripper, the cosine between the way of the hand to it and its z axis."""
    found = []
    for k in demonstration.switches:
        way_m = demonstration.actions[k].position_m - demonstration.actions[k - 1].position_m
        axis = quaternions.rotated(demonstration.actions[k].quaternion_xyzw, np.array([0.0, 0.0, 1.0]))
        if (length_m := float(np.linalg.norm(way_m))) > 0:
            found.append(float(way_m @ axis) / length_m)
    return found
