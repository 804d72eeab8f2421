"""The keyframe rules: the paper's equation, its authors' code, its ablation, and waypoints.

Waypoints are for recordings that do not rest: gripper switches, and as few poses between as keep the path. After
Automatic Waypoint Extraction (Shi et al. 2023, arXiv 2307.14326): the hand stays within a tolerance of straight motion
between them. A switch is where the hand was when the gripper had opened or closed: people move on while the fingers
still close.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from app.pipeline.keyframes.motion import Motion, Phase, stretches
from app.pipeline.keyframes.path import MAX_DEVIATION, TOLERANCE_DEG, TOLERANCE_M, off_line_m
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array

RuleName = Literal["auto", "waypoints", "merged", "authors", "uniform"]
RULES: tuple[RuleName, ...] = ("auto", "waypoints", "merged", "authors", "uniform")
SIMULATION_DELTA_RAD_S = 0.1  # paper, section IV-A; 0.01 on a real robot
MAX_KEYFRAMES = 25  # paper, section IV-B: the steps that an episode may take
FINAL_FRAME_MARGIN = 3  # frames before the last within which a keyframe stands for it
STOP_COOLDOWN = 4  # the authors' code (after PerAct): frames after a stop in which no other counts
WIDER = 1.25  # by which the tolerance of waypoints grows while a recording has more


class Keyframe(NamedTuple):
    """A frame that matters, and what the gripper does there: the hand goes to the pose, then the gripper acts."""

    frame: int
    gripper_open: bool


@dataclass(frozen=True)
class KeyframeRule:
    """How keyframes are chosen.

    Attributes:
        rule: `auto` takes `merged` where the recording rests at its keyframes, else `waypoints`; `waypoints` (gripper
            switches, and as few points between as keep the path within the tolerance), `merged` (the paper's equation,
            each run of hits one keyframe), `authors` (their published code) or `uniform` (every `interval`-th frame).
        delta_rad_s: joint speed below which the robot rests.
        interval: for `uniform`, the distance in frames.
        tolerance_m, tolerance_deg: for `waypoints`, how far the recorded hand may be from straight motion between
            neighboring keyframes.
    """

    rule: RuleName = "auto"
    delta_rad_s: float = SIMULATION_DELTA_RAD_S
    interval: int = 5
    tolerance_m: float = TOLERANCE_M
    tolerance_deg: float = TOLERANCE_DEG

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise InvalidInputError("keyframes.rule", f"is {self.rule!r}", ", ".join(RULES))
        for name, unit in (("delta_rad_s", "rad/s"), ("tolerance_m", "meters"), ("tolerance_deg", "degrees")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InvalidInputError(f"keyframes.{name}", f"is {value}", f"a positive number of {unit}")
        if self.interval < 1:
            raise InvalidInputError("keyframes.interval", f"is {self.interval}", "at least 1 frame")

    @property
    def aligned(self) -> bool:
        """Whether demonstrations of one plan are written with the same number of keyframes."""
        return self.rule in ("auto", "waypoints")


def merged(motion: Motion, delta_rad_s: float = SIMULATION_DELTA_RAD_S) -> tuple[int, ...]:
    """The frames by the paper's equation (section III-B), each maximal run with ||S_t|| < delta merged into one.

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
    """The frames by the authors' published code, without its wrap-around of frames before the first.

    During a dwell it finds one every 5 frames; it is for comparison and for RLBench's recordings.
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
    predecessors = []
    for k in range(1, number):
        reached = total[:, None] + squared
        predecessors.append(np.argmin(reached, axis=0))
        total = reached.min(axis=0) + preferred[k]
    chosen = [poses - 1]
    for predecessor in reversed(predecessors):
        chosen.append(int(predecessor[chosen[-1]]))
    return chosen[::-1]


def at_frames(phase: Phase, frames: Sequence[int]) -> list[Keyframe]:
    """The keyframes at these frames of a phase; the gripper acts at the last one."""
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
