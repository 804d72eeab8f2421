"""What the recorded hand did, as far as doubts need more of a recording than its keyframes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings.missed import Kept
from app.pipeline.keyframes import Motion
from app.pipeline.keyframes.motion import Switch
from app.pipeline.representation.anchors import M_PER_RAD
from roboprompt_client import quaternions
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import Trajectory

AT_OBJECT_M = 0.12  # a hand that closes or opens within this of an object's origin does so at the object
NEARER_M = 0.01  # a hand that comes nearer by this is still on its way to the object
HELD_M = 0.10  # an object as near to the first pose of the hand may be in it


class Act(NamedTuple):
    """The gripper switches.

    Attributes:
        opens: otherwise it closes.
        away_m: by name, how far the objects are from the hand there.
        later_m: the least distance from the nearest of them until the gripper switches again, or the recording ends.
        moved_m: how far the hand is from there when that happens; 10 degrees count as 1 cm.
    """

    opens: bool
    away_m: Mapping[str, float]
    later_m: float
    moved_m: float

    @property
    def nearest_m(self) -> float:
        """The distance of the nearest object."""
        return min(self.away_m.values())

    @property
    def approaches(self) -> bool:
        """Whether the hand is on its way to the nearest object, not at it."""
        return self.later_m < self.nearest_m - NEARER_M


@dataclass(frozen=True, eq=False)
class RecordedHand:
    """The hand of one recording.

    Attributes:
        kept: how closely the actions keep to it.
        starts_open: whether the fingers are open until the first act.
        acts: the switches of the gripper, without fingers that come to their place before the hand moves.
        start_m, end_m: (3,) where it is at first and at last.
        end_speed_m_s: at the last frame.
        nearest_m: the least distance from any object.
        may_hold: the objects so near to its first pose that it may hold them from the start.
    """

    kept: Kept
    starts_open: bool
    acts: tuple[Act, ...]
    start_m: Array
    end_m: Array
    end_speed_m_s: float
    nearest_m: float
    may_hold: frozenset[str]

    @property
    def ends_holding(self) -> bool:
        """Whether it closed on an object at last; a fist that then comes nearer to the object closed on nothing."""
        if not self.acts or self.acts[-1].opens:
            return False
        act = self.acts[-1]
        return act.nearest_m < AT_OBJECT_M and not act.approaches

    @classmethod
    def of(cls, motion: Motion, shown: Demonstration, kept: Kept) -> "RecordedHand":
        """What the demonstration's recording has."""
        trajectory, acting = motion.trajectory, motion.acting_switches
        away_m = _away_m(trajectory.positions_m, shown)
        ends = [*(switch.frame for switch in acting[1:]), len(trajectory) - 1]
        starts_open = not acting[0].opens if acting else bool(trajectory.gripper_open[-1])
        return cls(
            kept,
            starts_open,
            tuple(_act(trajectory, s, end, shown, away_m) for s, end in zip(acting, ends, strict=False)),
            trajectory.positions_m[0],
            trajectory.positions_m[-1],
            float(motion.hand_speeds_m_s[-1]),
            float(away_m.min()),
            frozenset(pose.name for pose, far_m in zip(shown.objects, away_m[0], strict=True) if far_m < HELD_M),
        )


def _away_m(positions_m: Array, shown: Demonstration) -> Array:
    """(T, N) from each object's place before the motion."""
    objects_m = np.array([pose.position_m for pose in shown.objects])
    away: Array = np.linalg.norm(positions_m[:, None] - objects_m[None], axis=2)
    return away


def _act(trajectory: Trajectory, switch: Switch, end: int, shown: Demonstration, away_m: Array) -> Act:
    place, frame = int(away_m[switch.frame].argmin()), switch.frame
    way_m = trajectory.positions_m[end] - trajectory.positions_m[frame]
    before, after = trajectory.quaternions_xyzw[frame], trajectory.quaternions_xyzw[end]
    turn_rad = quaternions.angle_between_rad(before, after)
    return Act(
        switch.opens,
        dict(zip((pose.name for pose in shown.objects), away_m[frame].tolist(), strict=True)),
        float(away_m[frame : end + 1, place].min()),
        float(np.linalg.norm(way_m)) + M_PER_RAD * turn_rad,
    )
