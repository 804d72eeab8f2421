"""Which frames of a trajectory matter: the robot rests, or the gripper opens or closes (paper, section III-B)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Trajectory
from app.pipeline.errors import InvalidInputError

Rule = Literal["merged", "authors", "uniform"]
RULES: tuple[Rule, ...] = ("merged", "authors", "uniform")
SIMULATION_DELTA_RAD_S = 0.1  # paper, section IV-A; 0.01 on a real robot
FINAL_FRAME_MARGIN = 3  # frames before the last within which a keyframe stands for it
STOP_COOLDOWN = 4  # the authors' code (after PerAct): frames after a stop in which no other counts


@dataclass(frozen=True)
class KeyframeRule:
    """How keyframes are chosen.

    Attributes:
        rule: `merged` (the paper's equation, each run of hits one keyframe), `authors` (their published code) or
            `uniform` (every `interval`-th frame).
        delta_rad_s: joint speed below which the robot rests.
        interval: for `uniform`, the distance in frames.
    """

    rule: Rule = "merged"
    delta_rad_s: float = SIMULATION_DELTA_RAD_S
    interval: int = 5

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise InvalidInputError("keyframes.rule", f"is {self.rule!r}", ", ".join(RULES))
        if not (np.isfinite(self.delta_rad_s) and self.delta_rad_s > 0):
            raise InvalidInputError("keyframes.delta_rad_s", f"is {self.delta_rad_s}", "a positive number of rad/s")
        if self.interval < 1:
            raise InvalidInputError("keyframes.interval", f"is {self.interval}", "at least 1 frame")


def find_keyframes(trajectory: Trajectory, rule: KeyframeRule) -> tuple[int, ...]:
    """The indices of the keyframes, ascending. Frame 0 is never one: the initial pose is always the same."""
    if rule.rule == "merged":
        return merged(trajectory, rule.delta_rad_s)
    if rule.rule == "authors":
        return authors(trajectory, rule.delta_rad_s)
    return uniform(trajectory, rule.interval)


def merged(trajectory: Trajectory, delta_rad_s: float = SIMULATION_DELTA_RAD_S) -> tuple[int, ...]:
    """The paper's equation, each maximal run of frames with ||S_t|| < delta merged into one keyframe.

    A run's keyframe is its last gripper change, or its last frame where the gripper does not change. A gripper change
    outside every run is a keyframe of its own; so is the final frame, unless a keyframe lies within 3 frames of it.
    """
    rests = np.linalg.norm(trajectory.joint_velocities_rad_s, axis=1) < delta_rad_s
    changes = _gripper_changes(trajectory)
    found = {frame for frame in changes if not rests[frame]}
    for first, last in _runs(rests):
        if first > 0:
            found.add(max((k for k in changes if first <= k <= last), default=last))
    final = len(trajectory) - 1
    if final > 0 and not any(final - frame <= FINAL_FRAME_MARGIN for frame in found):
        found.add(final)
    return tuple(sorted(found))


def authors(trajectory: Trajectory, delta_rad_s: float = SIMULATION_DELTA_RAD_S) -> tuple[int, ...]:
    """What the authors' published code does, without its wrap-around of frames before the first.

    It fires again every 5 frames of a dwell; kept for comparison and for RLBench's recordings.
    """
    is_open = trajectory.gripper_open
    rests = np.abs(trajectory.joint_velocities_rad_s).max(axis=1) <= delta_rad_s
    last = len(trajectory) - 1
    found: list[int] = []
    cooldown = 0
    for i in range(len(trajectory)):
        steady = i <= last - 2 and is_open[i] == is_open[i + 1] == is_open[max(i - 1, 0)] == is_open[max(i - 2, 0)]
        stopped = bool(cooldown <= 0 and steady and rests[i])
        cooldown = STOP_COOLDOWN if stopped else cooldown - 1
        if i > 0 and (is_open[i] != is_open[i - 1] or i == last or stopped):
            found.append(i)
    if len(found) > 1 and found[-1] - found[-2] == 1:
        del found[-2]
    return tuple(found)


def uniform(trajectory: Trajectory, interval: int) -> tuple[int, ...]:
    """Every `interval`-th frame and the last one (the paper's ablation, section IV-D)."""
    last = len(trajectory) - 1
    return tuple(sorted({*range(interval, last + 1, interval), last} - {0}))


def _gripper_changes(trajectory: Trajectory) -> list[int]:
    """Frames whose gripper command differs from the frame before."""
    changes: list[int] = (np.flatnonzero(np.diff(trajectory.gripper_open)) + 1).tolist()
    return changes


def _runs(hits: npt.NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last index of each maximal run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], hits, [False]))))
    for first, end in edges.reshape(-1, 2).tolist():
        yield first, end - 1
