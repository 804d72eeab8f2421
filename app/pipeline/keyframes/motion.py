"""Speeds, gripper switches, phases and paths of a recorded hand, computed once for rules, findings and checks."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import CONTROL_FREQUENCY_HZ, frame_times_s
from app.pipeline.keyframes.path import TOLERANCE_M, HandPath
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.trajectory import Trajectory

Manner = Literal["rests", "hesitates", "flows"]  # how a recording moves: `resting.manner_of`

M_PER_RAD = 0.06  # 10 degrees of rotation weigh as much as 1 cm of position
BLIP_S = 0.1  # fingers need longer to close on something
# The hand is slowest where it grasps or lets go. Fingers that are recorded a moment before (a command) or after (they
# close on something that is dragged along) are looked for there, in time and space this near.
SETTLES_WITHIN_S = 0.35
SETTLES_WITHIN_M = 0.04
MUCH_SLOWER = 0.6
RISE = 1.3  # a speed this much above the least so far ends the search: the hand goes on to something else
SPEED_NOISE_M_S = 0.01
START_REACH_M = 0.01
OPENING_REACH_M = 0.02  # the same of fingers that open: nothing was grasped before


class Switch(NamedTuple):
    """The gripper opens (or closes) at a frame and stays so until the next switch."""

    frame: int
    opens: bool


class Phase(NamedTuple):
    """A stretch of a recording with one state of the gripper: it ends where the gripper switches, or the recording.

    Attributes:
        first, last: frames; the last of one phase is the first of the next.
        gripper_open: while the hand is on its way.
        ends_open: what the gripper does at the end.
    """

    first: int
    last: int
    gripper_open: bool
    ends_open: bool


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory in time.

    Attributes:
        times_s: (T,) of the frames.
        manners: what `resting.manner_of` found, by its threshold in rad/s.
    """

    trajectory: Trajectory
    times_s: Array
    manners: dict[float, Manner] = field(default_factory=dict, init=False, repr=False)
    _paths: dict[tuple[int, int, float, float], HandPath] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, trajectory: Trajectory, control_frequency_hz: float = CONTROL_FREQUENCY_HZ) -> "Motion":
        """The motion of a recording.

        Args:
            control_frequency_hz: of a trajectory without timestamps.
        """
        return cls(trajectory, frame_times_s(trajectory, control_frequency_hz))

    def __len__(self) -> int:
        return len(self.trajectory)

    @cached_property
    def joint_speeds_rad_s(self) -> Array:
        """(T,) the norm over the joints, ||S_t|| in the paper."""
        speeds: Array = np.linalg.norm(self.trajectory.joint_velocities_rad_s, axis=1)
        return speeds

    @cached_property
    def hand_speeds_m_s(self) -> Array:
        """(T,) from the frame before to the frame after; turning counts as well."""
        last = len(self) - 1
        if last == 0:
            return np.zeros(1)
        frames = np.arange(last + 1)
        before, after = np.maximum(frames - 1, 0), np.minimum(frames + 1, last)
        positions_m, hands = self.trajectory.positions_m, self.trajectory.quaternions_xyzw
        way_m = np.linalg.norm(positions_m[after] - positions_m[before], axis=1)
        turn_rad = quaternions.angles_rad(hands[before], hands[after])
        speeds: Array = (way_m + M_PER_RAD * turn_rad) / np.maximum(self.times_s[after] - self.times_s[before], 1e-9)
        return speeds

    @cached_property
    def gripper_changes(self) -> tuple[int, ...]:
        """Frames whose recorded gripper state differs from the frame before."""
        return tuple((np.flatnonzero(np.diff(self.trajectory.gripper_open)) + 1).tolist())

    @cached_property
    def switches(self) -> tuple[Switch, ...]:
        """The gripper's switches, each where the hand is slowest nearby; blips do not count."""
        changes = self._changes_without_blips()
        frames: list[int] = []
        for k, frame in enumerate(changes):
            low = frames[-1] + 1 if frames else 1
            high = changes[k + 1] - 1 if k + 1 < len(changes) else len(self) - 1
            frames.append(self._slowest_nearby(frame, low, high))
        states = [bool(self.trajectory.gripper_open[frame]) for frame in changes]
        return tuple(map(Switch, frames, states))

    @cached_property
    def acting_switches(self) -> tuple[Switch, ...]:
        """The switches after the hand has left its first pose; before, fingers come to their place."""
        return tuple(switch for switch in self.switches if not self._at_start(switch))

    @cached_property
    def phases(self) -> tuple[Phase, ...]:
        """The recording cut at its gripper switches; fingers that come to their place at the start are no switch."""
        switches, initial = self.switches, bool(self.trajectory.gripper_open[0])
        while switches and self._at_start(switches[0]) and self._approaches(switches):
            initial, switches = switches[0].opens, switches[1:]
        final = len(self) - 1
        cuts = [0, *(switch.frame for switch in switches if 0 < switch.frame < final), final]
        states = [initial, *(switch.opens for switch in switches), (switches[-1].opens if switches else initial)]
        stretches = zip(pairwise(cuts), pairwise(states), strict=False)
        return tuple(Phase(first, last, state, after) for (first, last), (state, after) in stretches)

    def path(self, first: int, last: int, tolerance_m: float, tolerance_deg: float) -> HandPath:
        """The hand's way from frame `first` to frame `last`, in tolerances."""
        key = (first, last, tolerance_m, tolerance_deg)
        if key not in self._paths:
            within = (phase for phase in self.phases[1:] if phase.first <= first and last <= phase.last)
            held = any(not phase.gripper_open for phase in within)
            self._paths[key] = HandPath.between(self.trajectory, *key, held=held)
        return self._paths[key]

    def _changes_without_blips(self) -> list[int]:
        """The recorded changes without stretches shorter than `BLIP_S`."""
        frames, times_s = list(self.gripper_changes), self.times_s
        while short := [k for k in range(len(frames) - 1) if times_s[frames[k + 1]] - times_s[frames[k]] < BLIP_S]:
            del frames[short[0] : short[0] + 2]
        return frames

    def _slowest_nearby(self, frame: int, low: int, high: int) -> int:
        """The frame to which the speed falls, going on or back from `frame`; `frame` where it is slow already."""
        positions_m, times_s, speeds_m_s = self.trajectory.positions_m, self.times_s, self.hand_speeds_m_s
        best = frame
        for step in (1, -1):
            slowest, k = frame, frame + step
            while (
                low <= k <= high
                and abs(times_s[k] - times_s[frame]) <= SETTLES_WITHIN_S
                and np.linalg.norm(positions_m[k] - positions_m[frame]) <= SETTLES_WITHIN_M
                and speeds_m_s[k] <= RISE * speeds_m_s[slowest] + SPEED_NOISE_M_S
            ):
                if speeds_m_s[k] < speeds_m_s[slowest]:
                    slowest = k
                k += step
            if speeds_m_s[slowest] < MUCH_SLOWER * speeds_m_s[best] - SPEED_NOISE_M_S / 2:
                best = slowest
        return best

    def _at_start(self, switch: Switch) -> bool:
        """Whether the hand has not left its first pose when the gripper switches."""
        way_m = self.trajectory.positions_m[: switch.frame + 1] - self.trajectory.positions_m[0]
        reach_m = OPENING_REACH_M if switch.opens else START_REACH_M
        return bool(np.linalg.norm(way_m, axis=1).max() < reach_m)

    def _approaches(self, switches: Sequence[Switch]) -> bool:
        """Whether the hand comes to somewhere else before the gripper switches again or the recording ends."""
        start, end = switches[0].frame, switches[1].frame if len(switches) > 1 else len(self) - 1
        positions_m = self.trajectory.positions_m
        return end > start and not np.allclose(positions_m[start], positions_m[end], atol=TOLERANCE_M)


def stretches(states: npt.ArrayLike) -> list[tuple[int, int, bool]]:
    """The stretches of equal states (T,) bool: first frame, frame after the last, and state of each."""
    frames = np.asarray(states, dtype=bool)
    edges = [0, *(np.flatnonzero(np.diff(frames)) + 1).tolist(), len(frames)]
    return [(first, end, bool(frames[first])) for first, end in pairwise(edges)]
