"""What an action must satisfy before a robot carries it out; a breach is an error, never clipped.

The server checks every predicted action before it leaves, and the robot's side checks it again.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from app.pipeline.arrays import QUATERNION_NORM_TOLERANCE
from app.pipeline.episode import EndEffectorAction
from app.pipeline.errors import UnsafeActionError
from app.pipeline.reply import MAX_ACTIONS

ROUNDING_M = 1e-9  # a position on a bound, up to the last bits of its floats
ROUNDING_DEG = 1e-6
AXES = "xyz"


class Box(NamedTuple):
    """An axis-aligned box, in metres in the world frame: (3) opposite corners."""

    min_m: tuple[float, ...]
    max_m: tuple[float, ...]


class Pose(NamedTuple):
    """Where the end effector is: (3) m and (4) xyzw, in the world frame."""

    position_m: tuple[float, ...]
    quaternion_xyzw: tuple[float, ...]

    @classmethod
    def of(cls, action: EndEffectorAction) -> "Pose":
        """The pose that an action goes to."""
        return cls(tuple(action.position_m.tolist()), tuple(action.quaternion_xyzw.tolist()))


@dataclass(frozen=True)
class MotionLimits:
    """Bounds of what a robot may be told.

    Attributes:
        workspace: every target lies inside; None: no such bound.
        keep_out: no target lies inside any of them. The way between two targets is the robot's to plan.
        max_step_m, max_step_rotation_deg: between consecutive targets; None: no such bound.
    """

    workspace: Box | None = None
    keep_out: tuple[Box, ...] = ()
    max_step_m: float | None = None
    max_step_rotation_deg: float | None = None

    @classmethod
    def from_task(cls, document: Mapping[str, Any]) -> "MotionLimits":
        """The limits that a task's document (`GET /tasks/{name}`) tells."""
        limits = document["motion_limits"]
        boxes = (document["workspace"], *limits["keep_out"])
        workspace, *keep_out = (Box(tuple(box["min"]), tuple(box["max"])) for box in boxes)
        return cls(workspace, tuple(keep_out), limits["max_step_m"], limits["max_step_rotation_deg"])


class MotionGuard:
    """Checks the actions of one prediction in their order.

    Args:
        max_actions: one more is a breach.
        before: where the end effector is before the first action; None where nobody knows, and then the first step has
            no length.
    """

    def __init__(self, limits: MotionLimits, max_actions: int = MAX_ACTIONS, before: Pose | None = None) -> None:
        self._limits = limits
        self._max_actions = max_actions
        self._before = before
        self._index = 0

    def check(self, action: EndEffectorAction) -> None:
        """Let the next action pass.

        Raises:
            UnsafeActionError: naming its index, the value and the bound.
        """
        index, pose = self._index, Pose.of(action)
        if index >= self._max_actions:
            raise UnsafeActionError(index, "index", f"is {index}", f"at most {self._max_actions} actions")
        _check_values(index, pose, action.gripper_open)
        self._check_place(index, pose)
        if self._before is not None:
            self._check_step(index, self._before, pose)
        self._before, self._index = pose, index + 1

    def _check_place(self, index: int, pose: Pose) -> None:
        position_m, box = pose.position_m, self._limits.workspace
        if box is not None:
            for axis, value, low, high in zip(AXES, position_m, box.min_m, box.max_m, strict=True):
                if not low - ROUNDING_M <= value <= high + ROUNDING_M:
                    bound = f"{low:g} to {high:g} m, the workspace"
                    raise UnsafeActionError(index, f"position.{axis}", f"is {value:.6g} m", bound)
        for k, (min_m, max_m) in enumerate(self._limits.keep_out):
            if all(low < value < high for value, low, high in zip(position_m, min_m, max_m, strict=True)):
                bound = f"outside keep_out[{k}], {list(min_m)} to {list(max_m)} m"
                raise UnsafeActionError(index, "position", f"is {[round(value, 6) for value in position_m]} m", bound)

    def _check_step(self, index: int, before: Pose, pose: Pose) -> None:
        limits = self._limits
        if limits.max_step_m is not None:
            step_m = math.dist(before.position_m, pose.position_m)
            if step_m > limits.max_step_m + ROUNDING_M:
                message = f"is {step_m:.6g} m from the one before"
                raise UnsafeActionError(index, "position", message, f"at most {limits.max_step_m:g} m")
        if limits.max_step_rotation_deg is not None:
            turn_deg = angle_deg(before.quaternion_xyzw, pose.quaternion_xyzw)
            if turn_deg > limits.max_step_rotation_deg + ROUNDING_DEG:
                message = f"is turned by {turn_deg:.6g} degrees from the one before"
                bound = f"at most {limits.max_step_rotation_deg:g} degrees"
                raise UnsafeActionError(index, "quaternion_xyzw", message, bound)


def action_from_json(index: int, value: object) -> EndEffectorAction:
    """An action as the service sends it, nothing about it taken on trust.

    Raises:
        UnsafeActionError: if a member is missing, not finite, no unit quaternion or no boolean.
    """
    document: Mapping[str, Any] = value if isinstance(value, Mapping) else {}
    pose = Pose(_numbers(index, document, "position", 3), _numbers(index, document, "quaternion_xyzw", 4))
    gripper_open = document.get("gripper_open")
    _check_values(index, pose, gripper_open)
    return EndEffectorAction(np.array(pose.position_m), np.array(pose.quaternion_xyzw), gripper_open is True)


def angle_deg(first_xyzw: tuple[float, ...], second_xyzw: tuple[float, ...]) -> float:
    """The angle (0..180) between the rotations of two unit quaternions."""
    alike = sum(a * b for a, b in zip(first_xyzw, second_xyzw, strict=True)) >= 0  # q and -q are one rotation
    chord = math.dist(first_xyzw, second_xyzw if alike else [-value for value in second_xyzw])
    return math.degrees(4 * math.asin(min(1.0, chord / 2)))


def _check_values(index: int, pose: Pose, gripper_open: object) -> None:
    for name, values in (("position", pose.position_m), ("quaternion_xyzw", pose.quaternion_xyzw)):
        if not all(map(math.isfinite, values)):
            raise UnsafeActionError(index, name, f"is {list(values)}", "finite numbers")
    norm = math.hypot(*pose.quaternion_xyzw)
    if abs(norm - 1) > QUATERNION_NORM_TOLERANCE:
        raise UnsafeActionError(
            index, "quaternion_xyzw", f"has the norm {norm:.6g}", "a unit quaternion, order x y z w"
        )
    if gripper_open is not True and gripper_open is not False:
        raise UnsafeActionError(index, "gripper_open", f"is {gripper_open!r:.40}", "true or false")


def _numbers(index: int, document: Mapping[str, Any], name: str, length: int) -> tuple[float, ...]:
    values = document.get(name)
    if (
        not isinstance(values, list)
        or len(values) != length
        or any(isinstance(value, bool) or not isinstance(value, int | float) for value in values)
    ):
        raise UnsafeActionError(index, name, f"is {values!r:.80}", f"{length} numbers")
    try:
        return tuple(map(float, values))
    except OverflowError:
        raise UnsafeActionError(index, name, f"is {str(values)[:80]}", "finite numbers") from None
