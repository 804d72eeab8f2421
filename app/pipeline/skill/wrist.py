"""The half turn of a parallel gripper: turned by 180 degrees about its approach axis, it grasps in the same way.

The approach axis is the hand's z axis; the position of an action lies on it, between the fingers. Which of both turns
an arm reaches well follows from the wrist angles that recordings have.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.skill import turns
from app.pipeline.skill.recording import Rows
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

DOWN = np.array([1.0, 0.0, 0.0, 0.0])  # wrist angles are counted from a hand that points down, x forward
ALONG_APPROACH = 0.7  # least cosine (45 degrees) between a hand's motion to a grasp and its z axis
CLEARLY_DEG = 1.0  # a turn must be better by this, so that rounding does not decide


def half_turned(action: EndEffectorAction) -> EndEffectorAction:
    """Return the action with the hand turned by 180 degrees about its approach axis."""
    return replace(action, quaternion_xyzw=turns.product(action.quaternion_xyzw, turns.HALF_TURN))


class WristRange:
    """The range of recorded wrist angles: the hand's rotation about its approach axis.

    Args:
        plans: the rows of recordings.
        base_m: (3,) the base of an arm whose first joint is vertical. Angles are then relative to the direction from
            the base to the hand, because such an arm turns with it. None: they are relative to the world's axes.

    Attributes:
        approaches: whether hands reach their grasps along their z axis; otherwise a half turn changes the grasp.
    """

    def __init__(self, plans: Sequence[Rows], base_m: Array | None = None) -> None:
        self._base_m = base_m
        hands, rotations = (np.concatenate([getattr(rows, n).reshape(-1, d) for rows in plans]) for n, d in ARRAYS)
        angles = np.sort(self._angles_deg(hands, rotations) % 360)
        gaps = np.diff(angles, append=angles[0] + 360)
        self._start_deg = float(angles[(int(gaps.argmax()) + 1) % len(angles)])
        self._width_deg = 360 - float(gaps.max())
        along = np.concatenate([_along_approach(rows) for rows in plans])
        self.approaches = bool(along.size) and float(np.median(along)) >= ALONG_APPROACH

    def beyond_deg(self, actions: Iterable[EndEffectorAction]) -> float:
        """Return the largest distance of the actions' wrist angles from the recorded range; 0 inside it."""
        places, rotations = map(np.array, zip(*((a.position_m, a.quaternion_xyzw) for a in actions), strict=True))
        past_deg = (self._angles_deg(places, rotations) - self._start_deg) % 360 - self._width_deg
        return float(np.maximum(0.0, np.minimum(past_deg, 360 - self._width_deg - past_deg)).max())

    def _angles_deg(self, places: Array, rotations: Array) -> Array:
        _, _, z, w = np.moveaxis(turns.product(turns.inverse(DOWN), rotations), -1, 0)
        twists_deg: Array = np.degrees(2 * np.arctan2(z, w))
        if self._base_m is None:
            return twists_deg
        away_m = places - self._base_m
        # a hand that points down turns the other way
        return twists_deg + np.degrees(np.arctan2(away_m[:, 1], away_m[:, 0]))


ARRAYS = (("hand", 3), ("turn", 4))


def _along_approach(rows: Rows) -> Array:
    """Return for each switch of the gripper the cosines between the hands' motion to it and their z axes."""
    found = [np.zeros(0)]
    for k in rows.switches:
        if k:
            way_m = rows.hand[:, k] - rows.hand[:, k - 1]
            length_m = np.linalg.norm(way_m, axis=1)
            along_m = (way_m * turns.rotated(rows.turn[:, k], turns.UP)).sum(axis=1)
            found.append(along_m[length_m > 0] / length_m[length_m > 0])
    return np.concatenate(found)
