"""The published rules: the paper's equation (section III-B), its authors' code, and its ablation."""

import numpy as np

from app.pipeline.keyframes.motion import Motion, stretches
from app.pipeline.keyframes.rule import SIMULATION_DELTA_RAD_S

FINAL_FRAME_MARGIN = 3  # frames before the last within which a keyframe stands for it
STOP_COOLDOWN = 4  # the authors' code (after PerAct): frames after a stop in which no other counts


def merged(motion: Motion, delta_rad_s: float = SIMULATION_DELTA_RAD_S) -> tuple[int, ...]:
    """The paper's equation, each maximal run of frames with ||S_t|| < delta merged into one keyframe.

    A run's keyframe is its last gripper change, or its last frame where the gripper does not change. A gripper change
    outside every run is a keyframe of its own; so is the final frame, unless a keyframe lies within 3 frames of it.
    """
    rests, changes = motion.joint_speeds_rad_s < delta_rad_s, motion.gripper_changes
    found = {frame for frame in changes if not rests[frame]}
    for first, end, resting in stretches(rests):
        if resting and first > 0:
            found.add(max((k for k in changes if first <= k < end), default=end - 1))
    final = len(motion) - 1
    if final > 0 and not any(final - frame <= FINAL_FRAME_MARGIN for frame in found):
        found.add(final)
    return tuple(sorted(found))


def authors(motion: Motion, delta_rad_s: float = SIMULATION_DELTA_RAD_S) -> tuple[int, ...]:
    """What the authors' published code does, without its wrap-around of frames before the first.

    It fires again every 5 frames of a dwell; kept for comparison and for RLBench's recordings.
    """
    is_open = motion.trajectory.gripper_open
    rests = np.abs(motion.trajectory.joint_velocities_rad_s).max(axis=1) <= delta_rad_s
    last = len(motion) - 1
    found: list[int] = []
    cooldown = 0
    for i in range(len(motion)):
        steady = i <= last - 2 and is_open[i] == is_open[i + 1] == is_open[max(i - 1, 0)] == is_open[max(i - 2, 0)]
        stopped = bool(cooldown <= 0 and steady and rests[i])
        cooldown = STOP_COOLDOWN if stopped else cooldown - 1
        if i > 0 and (is_open[i] != is_open[i - 1] or i == last or stopped):
            found.append(i)
    if len(found) > 1 and found[-1] - found[-2] == 1:
        del found[-2]
    return tuple(found)


def uniform(motion: Motion, interval: int) -> tuple[int, ...]:
    """Every `interval`-th frame and the last one (the paper's ablation, section IV-D)."""
    last = len(motion) - 1
    return tuple(sorted({*range(interval, last + 1, interval), last} - {0}))
