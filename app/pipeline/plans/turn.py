"""The half turn of a parallel gripper: turned by 180 degrees about its approach axis, it grasps in the same way.

The approach axis is the hand's z axis; the position of an action lies on it, between the fingers. `turned_from_most`
finds demonstrations that grasp the other way round. `WristRange` measures how far actions leave the demonstrated wrist
angles, by which the service chooses a turn for the observed scene. The paper leaves the turn as recorded.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.episode import Demonstration
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

HALF_TURN = np.array([0.0, 0.0, 1.0, 0.0])  # about z
DOWN = np.array([1.0, 0.0, 0.0, 0.0])  # wrist angles are counted from a hand that points down, x forward
ALONG_APPROACH = 0.7  # least cosine (45 degrees) between a hand's motion to a grasp and its z axis
FOLDED_DEG, FOLDED_SHARE = 25.0, 0.5  # largest mean angle between folded grasps, and its share of the unfolded one
CLEARLY_DEG = 1.0  # a turn must be better by this, so that rounding does not decide


def half_turned(action: EndEffectorAction) -> EndEffectorAction:
    """Return the action with the hand turned by 180 degrees about its approach axis."""
    return replace(action, quaternion_xyzw=quaternions.product(action.quaternion_xyzw, HALF_TURN))


class WristRange:
    """The range of demonstrated wrist angles: the hand's rotation about its approach axis.

    Args:
        base_m: (3,) the base of an arm whose first joint is vertical. Angles are then relative to the direction from
            the base to the hand, because such an arm turns with it. None: they are relative to the world's axes.

    Attributes:
        approaches: see `grasps_along_approach`.
    """

    def __init__(self, demonstrations: Sequence[Demonstration], base_m: Array | None = None) -> None:
        self._base_m = base_m
        actions = [action for item in demonstrations for action in item.actions]
        angles = np.sort([self._angle_deg(action) % 360 for action in actions])
        gaps = np.diff(angles, append=angles[0] + 360)
        first = (int(gaps.argmax()) + 1) % len(angles)
        self._start_deg, self._width_deg = float(angles[first]), 360 - float(gaps.max())
        self.approaches = grasps_along_approach(demonstrations)

    def beyond_deg(self, actions: Iterable[EndEffectorAction]) -> float:
        """Return the largest distance of the actions' wrist angles from the demonstrated range; 0 inside it."""
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


def grasps_along_approach(demonstrations: Iterable[Demonstration]) -> bool:
    """Return whether hands reach their grasps along their z axis; otherwise a half turn changes the grasp."""
    along = [cosine for item in demonstrations for cosine in _along_approach(item)]
    return bool(along) and float(np.median(along)) >= ALONG_APPROACH


def _along_approach(demonstration: Demonstration) -> list[float]:
    """Return, for each gripper switch, the cosine between the hand's motion to it and the hand's z axis."""
    found = []
    for k in demonstration.switches:
        way_m = demonstration.actions[k].position_m - demonstration.actions[k - 1].position_m
        axis = quaternions.rotated(demonstration.actions[k].quaternion_xyzw, np.array([0.0, 0.0, 1.0]))
        if (length_m := float(np.linalg.norm(way_m))) > 0:
            found.append(float(way_m @ axis) / length_m)
    return found


def turned_from_most(demonstrations: Sequence[Demonstration]) -> list[bool]:
    """Return for each demonstration whether its first grasp is half a turn from that of most others.

    The grasps are compared in the world frame or that of an object, where they differ least.

    Args:
        demonstrations: of one form of instruction.
    """
    unchanged = [False] * len(demonstrations)
    if not all(item.switches for item in demonstrations) or not grasps_along_approach(demonstrations):
        return unchanged
    hands = [item.actions[item.switches[0]].quaternion_xyzw for item in demonstrations]
    least_deg, best = math.inf, (FOLDED_DEG, unchanged)
    for frames in _frames(demonstrations):
        pairs = zip(frames, hands, strict=True)
        seen = np.array([quaternions.product(quaternions.inverse(frame), hand) for frame, hand in pairs])
        turned = np.array([quaternions.product(hand, HALF_TURN) for hand in seen])
        apart_deg, turned_deg = (np.degrees(quaternions.angles_rad(seen[:, None], q)) for q in (seen, turned))
        least_deg = min(least_deg, float(apart_deg.mean(axis=1).min()))
        folded_deg = np.minimum(apart_deg, turned_deg).mean(axis=1)
        middle = int(folded_deg.argmin())
        turns = turned_deg[middle] < apart_deg[middle]
        best = min(best, (float(folded_deg[middle]), (turns if 2 * turns.sum() <= len(turns) else ~turns).tolist()))
    return best[1] if best[0] < FOLDED_SHARE * least_deg else unchanged


def _frames(demonstrations: Sequence[Demonstration]) -> Iterable[Sequence[Array]]:
    yield [quaternions.IDENTITY] * len(demonstrations)
    for place in range(len(demonstrations[0].ordered_objects)):
        known = [item.ordered_objects[place].quaternion_xyzw for item in demonstrations]
        rotations = [quaternion for quaternion in known if quaternion is not None]
        if len(rotations) == len(demonstrations):
            yield rotations
