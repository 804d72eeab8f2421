"""Keyframes of recordings that do not rest: gripper switches, and few poses between that keep the path.

A switch is where the hand was when the gripper had opened or closed: people move on while the fingers still close.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from app.pipeline.keyframes.path import HandPath, fewest_waypoints, off_line_m
from app.pipeline.keyframes.rule import MAX_KEYFRAMES, TOLERANCE_DEG, TOLERANCE_M, Keyframe, gripper_changes
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import Trajectory

BLIP_S = 0.1  # fingers need longer to close on something
# The hand is slowest where it grasps or lets go. Fingers that are recorded a moment before (a command) or after (they
# close on something that is dragged along) are looked for there, in time and space this near.
SETTLES_WITHIN_S = 0.35
SETTLES_WITHIN_M = 0.04
MUCH_SLOWER = 0.6
RISE = 1.3  # a speed this much above the least so far ends the search: the hand goes on to something else
SPEED_NOISE_M_S = 0.01
M_PER_RAD = 0.06  # 10 degrees of rotation count as 1 cm
START_REACH_M = 0.01
OPENING_REACH_M = 0.02  # the same of fingers that open: nothing was grasped before
WIDER = 1.25  # by which the tolerance grows while a recording has more


class Switch(NamedTuple):
    """The gripper opens (or closes) at a frame and stays so until the next switch."""

    frame: int
    opens: bool


def gripper_switches(trajectory: Trajectory, times_s: Array) -> tuple[Switch, ...]:
    """What the gripper does, each switch where the hand is slowest nearby; blips are none.

    Args:
        times_s: (T,) of the frames.
    """
    switches = _without_blips(trajectory, times_s)
    speeds_m_s = hand_speeds_m_s(trajectory, times_s)
    settled: list[Switch] = []
    for k, switch in enumerate(switches):
        low = settled[-1].frame + 1 if settled else 1
        high = switches[k + 1].frame - 1 if k + 1 < len(switches) else len(times_s) - 1
        frame = _slowest_nearby(switch.frame, low, high, trajectory.positions_m, times_s, speeds_m_s)
        settled.append(Switch(frame, switch.opens))
    return tuple(settled)


def at_start(switch: Switch, trajectory: Trajectory) -> bool:
    """Whether the hand has not left its first pose when the gripper switches: fingers that come to their place."""
    way_m = trajectory.positions_m[: switch.frame + 1] - trajectory.positions_m[0]
    reach_m = OPENING_REACH_M if switch.opens else START_REACH_M
    return bool(np.linalg.norm(way_m, axis=1).max() < reach_m)


def hand_speeds_m_s(trajectory: Trajectory, times_s: Array) -> Array:
    """(T,) from the frame before to the frame after; turning counts as well."""
    last = len(times_s) - 1
    if last == 0:
        return np.zeros(1)
    frames = np.arange(last + 1)
    before, after = np.maximum(frames - 1, 0), np.minimum(frames + 1, last)
    way_m = np.linalg.norm(trajectory.positions_m[after] - trajectory.positions_m[before], axis=1)
    quaternions = trajectory.quaternions_xyzw
    alike = np.abs(np.einsum("tk,tk->t", quaternions[before], quaternions[after]))
    turn_rad = 2 * np.arccos(np.clip(alike, 0, 1))
    speeds: Array = (way_m + M_PER_RAD * turn_rad) / np.maximum(times_s[after] - times_s[before], 1e-9)
    return speeds


def _without_blips(trajectory: Trajectory, times_s: Array) -> list[Switch]:
    """The recorded changes without stretches that are too short to be meant."""
    frames = gripper_changes(trajectory)
    while short := [k for k in range(len(frames) - 1) if times_s[frames[k + 1]] - times_s[frames[k]] < BLIP_S]:
        del frames[short[0] : short[0] + 2]
    return [Switch(frame, bool(trajectory.gripper_open[frame])) for frame in frames]


def _slowest_nearby(frame: int, low: int, high: int, positions_m: Array, times_s: Array, speeds_m_s: Array) -> int:
    """The frame to which the speed falls, going on or back from `frame`; `frame` where it is slow already."""
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


@dataclass(frozen=True)
class Phase:
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


def phases(trajectory: Trajectory, times_s: Array) -> tuple[Phase, ...]:
    """The recording cut at its gripper switches; fingers that come to their place at the start are no switch."""
    switches = gripper_switches(trajectory, times_s)
    initial = bool(trajectory.gripper_open[0])
    while switches and at_start(switches[0], trajectory) and _approaches(trajectory, switches):
        initial, switches = switches[0].opens, switches[1:]
    final = len(trajectory) - 1
    cuts = [0, *(switch.frame for switch in switches if 0 < switch.frame < final), final]
    states = [initial, *(switch.opens for switch in switches), (switches[-1].opens if switches else initial)]
    stretches = zip(pairwise(cuts), pairwise(states), strict=False)
    return tuple(Phase(first, last, state, after) for (first, last), (state, after) in stretches)


def _approaches(trajectory: Trajectory, switches: Sequence[tuple[int, bool]]) -> bool:
    """Whether the hand comes to somewhere else before the gripper switches again or the recording ends."""
    start = switches[0][0]
    end = switches[1][0] if len(switches) > 1 else len(trajectory) - 1
    return end > start and not np.allclose(trajectory.positions_m[start], trajectory.positions_m[end], atol=TOLERANCE_M)


def waypoints(
    trajectory: Trajectory, times_s: Array, tolerance_m: float = TOLERANCE_M, tolerance_deg: float = TOLERANCE_DEG
) -> tuple[Keyframe, ...]:
    """Gripper switches, the end, and as few poses between as keep the hand within the tolerance of straight motion.

    The tolerance is in metres and degrees and switches are distinguished in seconds, so that the rate of the recording
    does not matter; hesitation on the way and a frozen start leave no keyframe. A recording that needs more than 25
    keyframes is followed less closely.

    Args:
        times_s: (T,) of the frames.
    """
    if len(trajectory) == 1:
        return ()
    parts = phases(trajectory, times_s)
    scale = 1.0
    while True:
        found = [
            keyframe
            for phase in parts
            for keyframe in _of_phase(trajectory, phase, scale * tolerance_m, scale * tolerance_deg)
        ]
        if len(found) <= max(MAX_KEYFRAMES, len(parts)):
            return tuple(found)
        scale *= WIDER


def _of_phase(trajectory: Trajectory, phase: Phase, tolerance_m: float, tolerance_deg: float) -> list[Keyframe]:
    path = HandPath.between(trajectory, phase.first, phase.last, tolerance_m, tolerance_deg)
    chosen = [int(path.frames[k]) for k in fewest_waypoints(path.deviations())]
    return at_frames(trajectory, phase, at_tips(trajectory, phase.first, chosen, tolerance_m))


def at_frames(trajectory: Trajectory, phase: Phase, frames: Sequence[int]) -> list[Keyframe]:
    """Keyframes of a phase: the last has what the gripper does there."""
    return [Keyframe(frame, phase.ends_open if frame == phase.last else phase.gripper_open) for frame in frames]


def at_tips(trajectory: Trajectory, first: int, frames: Sequence[int], tolerance_m: float) -> list[int]:
    """The frames, those at which the hand turns back moved to where it turns: what it went there for is there."""
    moved = [first, *frames]
    positions_m = trajectory.positions_m
    for k in range(1, len(moved) - 1):
        before, here, after = moved[k - 1 : k + 2]
        if (positions_m[here] - positions_m[before]) @ (positions_m[after] - positions_m[here]) >= 0:
            continue
        near = np.arange(before + 1, after)
        near = near[np.linalg.norm(positions_m[near] - positions_m[here], axis=1) <= tolerance_m]
        reach_m = sum(np.linalg.norm(positions_m[near] - positions_m[end], axis=1) for end in (before, after))
        tip = int(near[np.argmax(reach_m)])
        if _bend_m(positions_m, before, tip, after) <= max(tolerance_m, _bend_m(positions_m, before, here, after)):
            moved[k] = tip
    return moved[1:]


def _bend_m(positions_m: Array, before: int, here: int, after: int) -> float:
    """How far the positions between are from the straight lines to and from `here`."""
    return max(off_line_m(positions_m[before : here + 1]), off_line_m(positions_m[here : after + 1]))
