"""What a keyframe is, and what can be chosen about keyframes."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from app.pipeline.keyframes.path import TOLERANCE_DEG, TOLERANCE_M
from roboprompt_client.errors import InvalidInputError

RuleName = Literal["auto", "waypoints", "merged", "authors", "uniform"]
RULES: tuple[RuleName, ...] = ("auto", "waypoints", "merged", "authors", "uniform")
SIMULATION_DELTA_RAD_S = 0.1  # paper, section IV-A; 0.01 on a real robot
MAX_KEYFRAMES = 25  # paper, section IV-B: the steps that an episode may take


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
