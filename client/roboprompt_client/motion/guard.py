"""Checks actions against limits of motion, one after the other.

The server checks every predicted action before it sends it, and the robot's side checks it again before it moves.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from roboprompt_client.errors import InvalidInputError, UnsafeActionError
from roboprompt_client.motion.limits import MAX_ACTIONS, Box, MotionLimits
from roboprompt_client.types.arrays import QUATERNION_NORM_TOLERANCE
from roboprompt_client.types.poses import EndEffectorAction, Pose

POSITION_ROUNDING_M = 1e-9  # a position on a bound may be beyond it by the rounding of floats
ANGLE_ROUNDING_DEG = 1e-6
AXES = "xyz"
Point = Sequence[float]  # (3) m


class MotionGuard:
    """Checks the actions of one prediction in their order.

    Args:
        max_actions: how many actions may pass.
        before: the end effector's pose before the first action. None: not known; then the way to the first target is
            not checked, and where steps are bounded the first action is refused.

    Raises:
        InvalidInputError: if `before` is not finite or its quaternion is not of unit length.
    """

    def __init__(self, limits: MotionLimits, max_actions: int = MAX_ACTIONS, before: Pose | None = None) -> None:
        if before is not None:
            _check_start(before)
        self._limits = limits
        self._max_actions = max_actions
        self._before = before
        self._index = 0

    def check(self, action: EndEffectorAction) -> None:
        """Let the next action pass, or raise UnsafeActionError with its index, the value and the bound."""
        index, pose = self._index, Pose.of(action)
        if index >= self._max_actions:
            raise UnsafeActionError(index, "index", f"is {index}", f"at most {self._max_actions} actions")
        self._check_workspace(index, pose)
        self._check_keep_out(index, self._before, pose)
        if self._before is not None:
            self._check_step(index, self._before, pose)
        elif self._limits.bounds_steps:
            bound = "a step whose length is known: give the end effector's pose (end_effector)"
            raise UnsafeActionError(index, "position", "is reached from an unknown place", bound)
        self._before, self._index = pose, index + 1

    def _check_workspace(self, index: int, pose: Pose) -> None:
        if (box := self._limits.workspace) is None:
            return
        for axis, value, low, high in zip(AXES, pose.position_m, box.min_m, box.max_m, strict=True):
            if not low - POSITION_ROUNDING_M <= value <= high + POSITION_ROUNDING_M:
                bound = f"{low:g} to {high:g} m, the workspace"
                raise UnsafeActionError(index, f"position.{axis}", f"is {value:.6g} m", bound)

    def _check_keep_out(self, index: int, before: Pose | None, pose: Pose) -> None:
        end_m, radius_m = pose.position_m, self._limits.hand_radius_m
        start_m = end_m if before is None else before.position_m
        for k, box in enumerate(self._limits.keep_out):
            if _far(start_m, end_m, box, radius_m):
                continue
            place, where = _shown(end_m), f"keep_out[{k}], {list(box.min_m)} to {list(box.max_m)} m"
            if passes_through(end_m, end_m, *box):
                raise UnsafeActionError(index, "position", f"is {place} m", f"outside {where}")
            for beginning_m, way in ((end_m, ""), (start_m, f", reached straight from {_shown(start_m)} m")):
                if enters(beginning_m, end_m, box, radius_m):
                    bound = f"at least {radius_m:g} m (hand_radius_m) outside {where}"
                    raise UnsafeActionError(index, "position", f"is {place} m{way}", bound)

    def _check_step(self, index: int, before: Pose, pose: Pose) -> None:
        limits = self._limits
        if limits.max_step_m is not None:
            step_m = math.dist(before.position_m, pose.position_m)
            if step_m > limits.max_step_m + POSITION_ROUNDING_M:
                message = f"is {step_m:.6g} m from the one before"
                raise UnsafeActionError(index, "position", message, f"at most {limits.max_step_m:g} m")
        if limits.max_step_rotation_deg is not None:
            turn_deg = angle_deg(before.quaternion_xyzw, pose.quaternion_xyzw)
            if turn_deg > limits.max_step_rotation_deg + ANGLE_ROUNDING_DEG:
                message = f"is turned by {turn_deg:.6g} degrees from the one before"
                bound = f"at most {limits.max_step_rotation_deg:g} degrees"
                raise UnsafeActionError(index, "quaternion_xyzw", message, bound)


def action_from_json(index: int, value: object) -> EndEffectorAction:
    """Return an action of the service's answer.

    Raises:
        UnsafeActionError: if a member is missing, not finite, not a unit quaternion or not a boolean.
    """
    document: Mapping[str, Any] = value if isinstance(value, Mapping) else {}
    place, turn = _numbers(index, document, "position", 3), _numbers(index, document, "quaternion_xyzw", 4)
    if not isinstance(gripper_open := document.get("gripper_open"), bool):
        raise UnsafeActionError(index, "gripper_open", f"is {gripper_open!r:.40}", "true or false")
    try:
        return EndEffectorAction(np.array(place), np.array(turn), gripper_open)
    except InvalidInputError as error:
        quantity = error.field.removeprefix("action.")
        raise UnsafeActionError(index, quantity, error.message, str(error.valid)) from error


def angle_deg(first_xyzw: tuple[float, ...], second_xyzw: tuple[float, ...]) -> float:
    """Return the angle (0..180) between the rotations of two unit quaternions."""
    same_sign = sum(a * b for a, b in zip(first_xyzw, second_xyzw, strict=True)) >= 0  # q and -q are one rotation
    chord = math.dist(first_xyzw, second_xyzw if same_sign else [-value for value in second_xyzw])
    return math.degrees(4 * math.asin(min(1.0, chord / 2)))


def _far(start_m: Point, end_m: Point, box: Box, radius_m: float) -> bool:
    """Return whether the plane of one face separates the sphere's way from the box; a quick test for most boxes."""
    return any(
        min(start, end) >= high + radius_m or max(start, end) <= low - radius_m
        for start, end, low, high in zip(start_m, end_m, *box, strict=True)
    )


def enters(start_m: Point, end_m: Point, box: Box, radius_m: float) -> bool:
    """Return whether a sphere that moves straight from start to end enters the box by more than rounding."""
    far = clearance_m(start_m, end_m, *box) >= radius_m - POSITION_ROUNDING_M
    if not far:  # also for NaN, which a way of infinite length gives
        return True
    smaller = [low + POSITION_ROUNDING_M for low in box.min_m], [high - POSITION_ROUNDING_M for high in box.max_m]
    return passes_through(start_m, end_m, *smaller)


def _shown(place_m: Point) -> list[float]:
    return [round(value, 6) for value in place_m]


def _check_start(pose: Pose) -> None:
    finite = all(map(math.isfinite, (*pose.position_m, *pose.quaternion_xyzw)))
    if not finite or abs(math.hypot(*pose.quaternion_xyzw) - 1) > QUATERNION_NORM_TOLERANCE:
        message = f"is {list(pose.position_m)}, {list(pose.quaternion_xyzw)}"
        raise InvalidInputError("end_effector", message, "3 finite numbers in m and a unit quaternion, order x y z w")


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


def passes_through(start_m: Point, end_m: Point, min_m: Point, max_m: Point) -> bool:
    """Return whether a point of the straight way from `start_m` to `end_m`, (3,) as the box's corners, is inside it."""
    entry, leave = -math.inf, math.inf
    for start, end, low, high in zip(start_m, end_m, min_m, max_m, strict=True):
        if (step := end - start) == 0:
            if not low < start < high:
                return False
            continue
        one, other = (low - start) / step, (high - start) / step
        entry, leave = max(entry, min(one, other)), min(leave, max(one, other))
    return entry < leave and entry < 1 and leave > 0


def clearance_m(start_m: Point, end_m: Point, min_m: Point, max_m: Point) -> float:
    """Return the least distance between the straight way from `start_m` to `end_m`, both (3,), and the box.

    The squared distance along the way is convex. It is a parabola between the points at which the way crosses the
    planes of the box's faces, so the minimum is found exactly.
    """
    steps = [end - start for start, end in zip(start_m, end_m, strict=True)]
    axes = list(zip(start_m, steps, min_m, max_m, strict=True))

    def beyond(part: float) -> list[float]:
        places = [(start + part * step, low, high) for start, step, low, high in axes]
        return [place - high if place > high else min(place - low, 0.0) for place, low, high in places]

    def slope(part: float) -> float:
        return sum(away * step for away, step in zip(beyond(part), steps, strict=True))

    before, rising_before = 0.0, slope(0.0)
    if rising_before >= 0:
        return math.hypot(*beyond(0.0))
    for part in _crossings(axes):
        if (rising := slope(part)) >= 0:
            nearest = before + (part - before) * rising_before / (rising_before - rising)
            return math.hypot(*beyond(nearest))
        before, rising_before = part, rising
    return math.hypot(*beyond(1.0))


def _crossings(axes: list[tuple[float, float, float, float]]) -> list[float]:
    """Return the parts (0..1] of the way at which it crosses planes of the box's faces, ascending, and 1."""
    parts = [(face - start) / step for start, step, *faces in axes if step != 0 for face in faces]
    return [*sorted(part for part in parts if 0 < part < 1), 1.0]
