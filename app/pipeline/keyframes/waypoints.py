"""Keyframes of recordings that do not rest: gripper switches, and few poses between that keep the path.

A switch is where the hand was when the gripper had opened or closed: people move on while the fingers still close.
"""

from collections.abc import Sequence

import numpy as np

from app.pipeline.keyframes.motion import Motion, Phase
from app.pipeline.keyframes.path import TOLERANCE_DEG, TOLERANCE_M, fewest_waypoints, off_line_m
from app.pipeline.keyframes.rule import MAX_KEYFRAMES, Keyframe
from roboprompt_client.arrays import Array

WIDER = 1.25  # by which the tolerance grows while a recording has more


def waypoints(
    motion: Motion, tolerance_m: float = TOLERANCE_M, tolerance_deg: float = TOLERANCE_DEG
) -> tuple[Keyframe, ...]:
    """Gripper switches, the end, and as few poses between as keep the hand within the tolerance of straight motion.

    The tolerance is in metres and degrees and switches are distinguished in seconds, so that the rate of the recording
    does not matter; hesitation on the way and a frozen start leave no keyframe. A recording that needs more than 25
    keyframes is followed less closely.
    """
    if len(motion) == 1:
        return ()
    scale = 1.0
    while True:
        found = [
            keyframe
            for phase in motion.phases
            for keyframe in _of_phase(motion, phase, scale * tolerance_m, scale * tolerance_deg)
        ]
        if len(found) <= max(MAX_KEYFRAMES, len(motion.phases)):
            return tuple(found)
        scale *= WIDER


def _of_phase(motion: Motion, phase: Phase, tolerance_m: float, tolerance_deg: float) -> list[Keyframe]:
    path = motion.path(phase.first, phase.last, tolerance_m, tolerance_deg)
    chosen = [int(path.frames[k]) for k in fewest_waypoints(path.deviations)]
    return at_frames(phase, at_tips(motion.trajectory.positions_m, phase.first, chosen, tolerance_m))


def at_frames(phase: Phase, frames: Sequence[int]) -> list[Keyframe]:
    """Keyframes of a phase: the last has what the gripper does there."""
    return [Keyframe(frame, phase.ends_open if frame == phase.last else phase.gripper_open) for frame in frames]


def at_tips(positions_m: Array, first: int, frames: Sequence[int], tolerance_m: float) -> list[int]:
    """The frames, those at which the hand turns back moved to where it turns: what it went there for is there.

    Args:
        positions_m: (T, 3) of the hand.
        first: the frame that the hand comes from.
    """
    moved = [first, *frames]
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
