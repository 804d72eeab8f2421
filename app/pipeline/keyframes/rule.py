"""What can be chosen about keyframes, what a keyframe is, and the rules.

Published are those of the paper (section III-B), of its authors' code and of its ablation. `waypoints` is for
recordings that do not rest: gripper switches, and few poses between that keep the path. A switch is where the hand was
when the gripper had opened or closed: people move on while the fingers still close.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from app.pipeline.episode import stretches
from app.pipeline.keyframes.motion import Motion, Phase
from app.pipeline.keyframes.path import TOLERANCE_DEG, TOLERANCE_M, at_tips, fewest_waypoints
from roboprompt_client.errors import InvalidInputError

Rule = Literal["auto", "waypoints", "merged", "authors", "uniform"]
RULES: tuple[Rule, ...] = ("auto", "waypoints", "merged", "authors", "uniform")
SIMULATION_DELTA_RAD_S = 0.1  # paper, section IV-A; 0.01 on a real robot
MAX_KEYFRAMES = 25  # paper, section IV-B: the steps that an episode may take
FINAL_FRAME_MARGIN = 3  # frames before the last within which a keyframe stands for it
WIDER = 1.25  # by which the tolerance of waypoints grows while a recording has more
STOP_COOLDOWN = 4  # the authors' code (after PerAct): frames after a stop in which no other counts


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

    rule: Rule = "auto"
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


def at_frames(phase: Phase, frames: Sequence[int]) -> list[Keyframe]:
    """Keyframes of a phase: the last has what the gripper does there."""
    return [Keyframe(frame, phase.ends_open if frame == phase.last else phase.gripper_open) for frame in frames]
