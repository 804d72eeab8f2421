"""Parts of a task's settings: where actions may lie, how keyframes are found, what the hand keeps out of."""

from functools import lru_cache
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from app.perception.object_model import Meters, Number
from app.pipeline.keyframes import SIMULATION_DELTA_RAD_S, KeyframeRule, RuleName
from app.pipeline.keyframes.path import TOLERANCE_DEG, TOLERANCE_M
from app.pipeline.workspace import RLBENCH_MAX_M, RLBENCH_MIN_M, Workspace
from roboprompt_client.motion.limits import HAND_RADIUS_M
from roboprompt_client.types.arrays import MAX_M


def _no_truth_value(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError(f"{value} is no number")
    return value


# For numbers that the address of a page may carry as text.
NOT_A_TRUTH_VALUE = BeforeValidator(_no_truth_value)
Point = tuple[Meters, Meters, Meters]
Preset = Literal["auto", "rlbench"]


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class WorkspaceSettings(_Settings):
    """The box that the position bins divide and that actions keep to, in meters in the world frame.

    `auto`: what the first 100 present demonstrations span with a margin, at least a meter wide; those are left apart
    that reach far beyond the others. `rlbench`: RLBench's. A box of one's own has no preset.
    """

    preset: Preset | None = None
    min: Point = RLBENCH_MIN_M  # of `auto` it is not stored
    max: Point = RLBENCH_MAX_M

    @model_validator(mode="before")
    @classmethod
    def _named(cls, value: object) -> object:
        """A preset by its name alone."""
        return {"preset": value} if isinstance(value, str) else value

    @model_validator(mode="after")
    def _box_of_preset(self) -> Self:
        if self.preset == "rlbench" and (self.min, self.max) != (RLBENCH_MIN_M, RLBENCH_MAX_M):
            raise ValueError("the preset rlbench has a box of its own: leave out preset, or min and max")
        return self

    def workspace(self) -> Workspace:
        """Return the pipeline's workspace; raises InvalidInputError if min is not below max."""
        return _workspace(self.min, self.max)


class KeyframeSettings(_Settings):
    """How keyframes are found.

    `auto`: `merged` where a recording rests at its keyframes, else `waypoints`. `merged` is the paper's rule with runs
    merged, `authors` their published code, `uniform` every interval-th frame.
    """

    rule: RuleName = "auto"
    delta_rad_s: Annotated[
        float, Field(ge=1e-6, le=1000, description="0.1 in simulation, 0.01 on a real robot"), NOT_A_TRUTH_VALUE
    ] = SIMULATION_DELTA_RAD_S
    interval: Annotated[int, Field(ge=1, le=10_000), NOT_A_TRUTH_VALUE] = 5
    tolerance_m: Annotated[
        float,
        Field(ge=1e-6, le=1, description="waypoints: how far the hand may stray from straight motion"),
        NOT_A_TRUTH_VALUE,
    ] = TOLERANCE_M
    tolerance_deg: Annotated[
        float, Field(ge=1e-6, le=180, description="the same of its rotation"), NOT_A_TRUTH_VALUE
    ] = TOLERANCE_DEG

    def keyframe_rule(self) -> KeyframeRule:
        return KeyframeRule(self.rule, self.delta_rad_s, self.interval, self.tolerance_m, self.tolerance_deg)

    def in_words(self) -> str:
        """Describe the rule for people: ``at rest below 0.1 rad/s``."""
        rest, path = (
            f"at rest below {self.delta_rad_s:g} rad/s",
            f"within {self.tolerance_m:g} m and {self.tolerance_deg:g}°",
        )
        if self.rule == "uniform":
            return f"every {self.interval} frames"
        return {"auto": f"{rest}, else {path}", "waypoints": path}.get(self.rule, rest)


class KeepOutBox(_Settings):
    """A box that the hand keeps out of, in meters in the world frame."""

    min: Point
    max: Point

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        if any(low >= high for low, high in zip(self.min, self.max, strict=True)):
            raise ValueError(f"min {list(self.min)} is not below max {list(self.max)} on every axis")
        return self


@lru_cache(256)  # a prediction asks for its task's several times
def _workspace(low_m: Point, high_m: Point) -> Workspace:
    return Workspace(np.array(low_m), np.array(high_m))


class MotionLimitsSettings(_Settings):
    """Bounds of predicted actions beyond the workspace. An action beyond one is an error, never clipped.

    A bound goes only by an explicit null, boxes by [] or null; what a request leaves out stays as it is.
    """

    keep_out: Annotated[
        tuple[KeepOutBox, ...],
        Field(max_length=64, description="boxes that the hand keeps out of, at targets and straight between them"),
        BeforeValidator(lambda value: () if value is None else value, tuple[KeepOutBox, ...] | None),
    ] = ()
    max_step_m: Annotated[
        Number | None,
        Field(gt=0, le=MAX_M, description="between consecutive targets; requests then need `end_effector`"),
    ] = None
    max_step_rotation_deg: Annotated[Number | None, Field(gt=0, le=180, description="as max_step_m, in degrees")] = None
    hand_radius_m: Annotated[
        Number, Field(ge=0, le=1, description="of a sphere around the end effector, which keeps out of the boxes")
    ] = HAND_RADIUS_M
