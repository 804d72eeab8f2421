"""What can be chosen about keyframes, what a keyframe is, and the rules that were published.

These are the rules of the paper (section III-B), of its authors' code and of its ablation.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import Trajectory

Rule = Literal["auto", "waypoints", "merged", "authors", "uniform"]
RULES: tuple[Rule, ...] = ("auto", "waypoints", "merged", "authors", "uniform")
SIMULATION_DELTA_RAD_S = 0.1  # paper, section IV-A; 0.01 on a real robot
TOLERANCE_M = 0.01
TOLERANCE_DEG = 15.0
MAX_KEYFRAMES = 25  # paper, section IV-B: the steps that an episode may take
FINAL_FRAME_MARGIN = 3  # frames before the last within which a keyframe stands for it
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
            neighbouring keyframes.
    """

    rule: Rule = "auto"
    delta_rad_s: float = SIMULATION_DELTA_RAD_S
    interval: int = 5
    tolerance_m: float = TOLERANCE_M
    tolerance_deg: float = TOLERANCE_DEG

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise InvalidInputError("keyframes.rule", f"is {self.rule!r}", ", ".join(RULES))
        for name, unit in (("delta_rad_s", "rad/s"), ("tolerance_m", "metres"), ("tolerance_deg", "degrees")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InvalidInputError(f"keyframes.{name}", f"is {value}", f"a positive number of {unit}")
        if self.interval < 1:
            raise InvalidInputError("keyframes.interval", f"is {self.interval}", "at least 1 frame")

    @property
    def aligned(self) -> bool:
        """Whether demonstrations of one plan are written with the same number of keyframes."""
        return self.rule in ("auto", "waypoints")


def merged(trajectory: Trajectory, delta_rad_s: float = SIMULATION_DELTA_RAD_S) -> tuple[int, ...]:
    """The paper's equation, each maximal run of frames with ||S_t|| < delta merged into one keyframe.

    A run's keyframe is its last gripper change, or its last frame where the gripper does not change. A gripper change
    outside every run is a keyframe of its own; so is the final frame, unless a keyframe lies within 3 frames of it.
    """
    rests = resting_frames(trajectory, delta_rad_s)
    changes = gripper_changes(trajectory)
    found = {frame for frame in changes if not rests[frame]}
    for first, last in runs(rests):
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


def resting_frames(trajectory: Trajectory, delta_rad_s: float) -> npt.NDArray[np.bool_]:
    """(T,) whether ||S_t|| < delta: the paper's test."""
    rests: npt.NDArray[np.bool_] = np.linalg.norm(trajectory.joint_velocities_rad_s, axis=1) < delta_rad_s
    return rests


def gripper_changes(trajectory: Trajectory) -> list[int]:
    """Frames whose gripper state differs from the frame before."""
    changes: list[int] = (np.flatnonzero(np.diff(trajectory.gripper_open)) + 1).tolist()
    return changes


def runs(hits: npt.NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last index of each maximal run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], hits, [False]))))
    for first, end in edges.reshape(-1, 2).tolist():
        yield first, end - 1
