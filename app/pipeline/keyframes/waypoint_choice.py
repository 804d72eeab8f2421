"""Waypoints, for recordings that do not rest: gripper switches, and as few poses between as keep the path.

After Automatic Waypoint Extraction (Shi et al. 2023, arXiv 2307.14326): the hand stays within a tolerance of straight
motion between them. A switch is where the hand was when the gripper had opened or closed: people move on while the
fingers still close.
"""

from collections.abc import Sequence

import numpy as np

from app.pipeline.keyframes.motion import Motion, Phase
from app.pipeline.keyframes.path import MAX_DEVIATION, TOLERANCE_DEG, TOLERANCE_M, off_line_m
from app.pipeline.keyframes.rule import MAX_KEYFRAMES, Keyframe
from roboprompt_client.types.arrays import Array

WIDER = 1.25  # by which the tolerance of waypoints grows while a recording has more


def waypoints(
    motion: Motion, tolerance_m: float = TOLERANCE_M, tolerance_deg: float = TOLERANCE_DEG
) -> tuple[Keyframe, ...]:
    """Gripper switches, the end, and as few poses between as keep the hand within the tolerance of straight motion.

    The tolerance is in meters and degrees and switches are distinguished in seconds, so that the rate of the recording
    does not matter; hesitation on the way and a frozen start leave no keyframe. A recording that needs more than 25
    keyframes is followed less closely.
    """
    if len(motion) == 1:
        return ()
    scale = 1.0
    most = max(MAX_KEYFRAMES, len(motion.phases))
    while (chosen := _fewest_frames(motion, most, scale * tolerance_m, scale * tolerance_deg)) is None:
        scale *= WIDER
    positions_m = motion.trajectory.positions_m
    return tuple(
        keyframe
        for phase, frames in zip(motion.phases, chosen, strict=True)
        for keyframe in at_frames(phase, at_tips(positions_m, phase.first, frames, scale * tolerance_m))
    )


def _fewest_frames(motion: Motion, most: int, tolerance_m: float, tolerance_deg: float) -> list[list[int]] | None:
    """The frames of each phase that keep its path; None as soon as they are known to be more than `most`."""
    number, paths = len(motion.phases), []
    for phase in motion.phases:
        paths.append(motion.path(phase.first, phase.last, tolerance_m, tolerance_deg))
        number += paths[-1].bend > 1  # it takes two at least
        if number > most:
            return None
    found = []
    for path in paths:
        found.append([int(path.frames[k]) for k in fewest_waypoints(path.deviations)])
        number += len(found[-1]) - (2 if path.bend > 1 else 1)
        if number > most:
            return None
    return found


def fewest_waypoints(deviations: Array) -> list[int]:
    """Return the fewest poses, with the last, that leave deviations of at most 1; of several the closest."""
    number = len(deviations)
    total = np.concatenate([[0.0], np.full(number - 1, np.inf)])
    before = np.zeros(number, dtype=int)
    steps = np.where(deviations <= 1, number * MAX_DEVIATION**2 + deviations**2, np.inf)
    for j in range(1, number):
        cost = total[:j] + steps[:j, j]
        before[j] = int(np.argmin(cost))
        total[j] = cost[before[j]]
    chosen = [number - 1]
    while (earlier := int(before[chosen[-1]])) > 0:
        chosen.append(earlier)
    return chosen[::-1]


def best_waypoints(deviations: Array, number: int, costs: Array | None = None) -> list[int]:
    """Return exactly `number` poses, with the last, of the least sum of squared deviations and costs.

    Args:
        costs: (number, N) of each pose as each waypoint; None for no preference.

    Returns:
        ascending indices; the last pose repeats where there are fewer poses than `number`.
    """
    poses = len(deviations)
    if poses - 1 <= number:
        return [*range(1, poses), *[poses - 1] * (number - poses + 1)]
    preferred = np.zeros((number, poses)) if costs is None else costs
    squared = np.where(np.tri(poses, dtype=bool), np.inf, deviations**2)
    total = squared[0] + preferred[0]
    befores = []
    for k in range(1, number):
        reached = total[:, None] + squared
        befores.append(np.argmin(reached, axis=0))
        total = reached.min(axis=0) + preferred[k]
    chosen = [poses - 1]
    for before in reversed(befores):
        chosen.append(int(before[chosen[-1]]))
    return chosen[::-1]


def at_frames(phase: Phase, frames: Sequence[int]) -> list[Keyframe]:
    """Keyframes of a phase: the last has what the gripper does there."""
    return [Keyframe(frame, phase.ends_open if frame == phase.last else phase.gripper_open) for frame in frames]


def at_tips(positions_m: Array, first: int, frames: Sequence[int], tolerance_m: float) -> list[int]:
    """Return the frames with those near a reversal of the hand moved to the reversal itself, where the hand acts.

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
    """Return the largest distance of the positions from the straight lines to and from `here`."""
    return max(off_line_m(positions_m[before : here + 1]), off_line_m(positions_m[here : after + 1]))
