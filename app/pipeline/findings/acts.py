"""What a hand does where its gripper switches: at which object, how near it comes to it, and how far it goes on."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes.motion import Motion, Switch
from app.pipeline.thresholds import M_PER_RAD
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array

AT_OBJECT_M = 0.12  # a hand that closes or opens within this of an object's origin does so at the object
NEARER_M = 0.01  # a hand that comes nearer by this is still on its way to the object
# A hand that moves faster than this where fingers switch, and is slower by this factor nearer to the object within a
# few seconds, grasps there
MOVES_ON_M_S, SLOWER, BESIDE_S = 0.03, 5.0, 2.0


class Act(NamedTuple):
    """A switch of the gripper.

    Attributes:
        opens: False where it closes.
        away_m: the distances of the objects from the hand there, by name.
        least_m: the least distance from the nearest of them between the switches before and after this one.
        at_object: whether the hand is at the nearest object, not on its way to it.
        moved_m: the distance to where the hand is at the next switch, or at the end; 10 degrees count as 1 cm.
        moves_on: whether the hand moves there, and rests nearer to the object before or after, as if two clocks differ.
        passes_over: whether the hand comes to less than half of that distance only later and in motion, as one does
            that holds something at its end.
    """

    opens: bool
    away_m: Mapping[str, float]
    least_m: float
    at_object: bool
    moved_m: float
    moves_on: bool
    passes_over: bool

    @property
    def nearest(self) -> str:
        """The name of the nearest object."""
        return min(self.away_m, key=self.away_m.__getitem__)

    @property
    def nearest_m(self) -> float:
        """Its distance."""
        return self.away_m[self.nearest]


def act_of(motion: Motion, switch: Switch, first: int, end: int, shown: Demonstration, away_m: Array) -> Act:
    """Return what the hand does at a switch of the gripper.

    Args:
        first, end: the frames of the switches before and after it, or of the recording's ends.
        away_m: (T, N) the distances of the hand from the objects.
    """
    trajectory, frame = motion.trajectory, switch.frame
    of_name = dict(zip((pose.name for pose in shown.objects), away_m[frame].tolist(), strict=True))
    nearest_m = away_m[:, away_m[frame].argmin()]
    near_m = min(of_name.values())
    at_object = near_m < AT_OBJECT_M and bool(nearest_m[frame : end + 1].min() >= near_m - NEARER_M)
    way_m = float(np.linalg.norm(trajectory.positions_m[end] - trajectory.positions_m[frame]))
    turn_rad = quaternions.angle_between_rad(trajectory.quaternions_xyzw[frame], trajectory.quaternions_xyzw[end])
    least_m = float(nearest_m[first : end + 1].min())
    moves_on = _moves_on(motion, frame, slice(first, end + 1), nearest_m)
    passes_over = _passes_over(motion, frame, slice(first, end + 1), nearest_m)
    return Act(switch.opens, of_name, least_m, at_object, way_m + M_PER_RAD * turn_rad, moves_on, passes_over)


def _moves_on(motion: Motion, frame: int, between: slice, nearest_m: Array) -> bool:
    """Return whether the hand moves in a frame, and rests nearer to an object in another.

    Args:
        between: the frames between the switches before and after.
        nearest_m: (T,) the distances from the object.
    """
    speed_m_s, off_s = motion.hand_speeds_m_s[frame], np.abs(motion.times_s[between] - motion.times_s[frame])
    rests = SLOWER * motion.hand_speeds_m_s[between] < speed_m_s
    nearer = nearest_m[between] < nearest_m[frame] - NEARER_M
    return bool(speed_m_s > MOVES_ON_M_S and (rests & nearer & (off_s < BESIDE_S)).any())


def _passes_over(motion: Motion, frame: int, between: slice, nearest_m: Array) -> bool:
    """Return whether the hand comes to less than half of its distance in a frame later only, and never slowly.

    Args:
        between, nearest_m: as of `_moves_on`.
    """
    nearer = np.flatnonzero(nearest_m[between] < nearest_m[frame] / 2) + between.start
    return bool((nearer > frame).all() and (motion.hand_speeds_m_s[nearer] > MOVES_ON_M_S).all())
