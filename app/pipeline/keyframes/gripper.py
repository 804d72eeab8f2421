"""When the gripper has opened or closed, and where the hand was: people move on while the fingers still close."""

from typing import NamedTuple

import numpy as np

from app.pipeline.keyframes.rule import gripper_changes
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
    return bool(np.linalg.norm(way_m, axis=1).max() < START_REACH_M)


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
