"""When a motion counts as done, when contact ends it, and whether a steered hand may go on."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from roboprompt_client.arms.driver import STEERED_S, ArmState
from roboprompt_client.errors import MotionError, UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import Box, MotionLimits, checked_bound
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

BRAKING_S = 0.25
AHEAD_S = STEERED_S + BRAKING_S  # how long the hand may still move after the last command


@dataclass(frozen=True)
class Tolerance:
    """How exactly the end effector must arrive, how long a motion may take, and how much force it may meet.

    Attributes:
        max_contact_force_n: checked about 20 times a second while the arm moves; None: not checked.

    Raises:
        InvalidInputError: for a bound that is not a finite number above 0.
    """

    position_m: float = 0.005
    rotation_deg: float = 2.0
    width_m: float = 0.004
    motion_s: float = 120.0
    max_contact_force_n: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            if (value := getattr(self, field.name)) is not None or field.default is not None:
                checked_bound(f"tolerance.{field.name}", value)

    def check_pose(self, state: ArmState, action: EndEffectorAction) -> None:
        """Raise MotionError if the end effector is not at the action's pose, both in the world frame."""
        off_m, off_deg = state.distance_to(action.position_m, action.quaternion_xyzw)
        if not (off_m <= self.position_m and off_deg <= self.rotation_deg):
            raise MotionError(f"the motion ended {1000 * off_m:.1f} mm and {off_deg:.1f} degrees off its target")

    def check_contact(self, state: Callable[[], ArmState]) -> None:
        """Raise MotionError if the hand meets too much force; `state` is called only if there is a bound."""
        if self.max_contact_force_n is not None and (problem := self.contact(state())):
            raise MotionError(problem)

    def contact(self, state: ArmState, velocity_m_s: Array | None = None) -> str:
        """Return which force is too large and where; empty if none, or if the velocity (3,) leads away from it."""
        wrench, most_n = state.wrench_n_nm, self.max_contact_force_n
        if wrench is None or most_n is None or state.force_n <= most_n:
            return ""
        if velocity_m_s is not None and velocity_m_s @ wrench[:3] > 0:
            return ""
        where_m = state.position_m.round(3).tolist()
        return f"the hand met {state.force_n:.1f} N at {where_m} m, at most {most_n:g} N are allowed"

    def check_gripper(self, width_m: float, open_width_m: float, *, is_open: bool) -> None:
        """Raise MotionError if the fingers, `open_width_m` apart when open, did not do as commanded."""
        if not math.isfinite(width_m):
            raise MotionError(f"the gripper's width is {width_m} m: whether it did as commanded is not known")
        if is_open and width_m < open_width_m - self.width_m:
            of_mm = f"{1000 * width_m:.1f} of {1000 * open_width_m:.1f} mm"
            raise MotionError(f"the gripper was to open, but measures {of_mm}")
        if not is_open and width_m > open_width_m - self.width_m:
            raise MotionError(f"the gripper was to close, but still measures {1000 * width_m:.1f} mm")


def problem_ahead(
    now: ArmState,
    velocity_m_s: Array,
    turning_rad_s: Array,
    limits: MotionLimits,
    check: Callable[[EndEffectorAction], object],
) -> str:
    """Return why a steered hand must stop; empty if it may go on. A hand outside the workspace may return into it.

    Args:
        now, velocity_m_s, turning_rad_s: in the world frame; the velocities are (3,).
        check: raises MotionError for a pose out of reach.
    """
    if not (velocity_m_s.any() or turning_rad_s.any()):
        return ""
    ahead = EndEffectorAction(*now.moved(velocity_m_s, turning_rad_s, AHEAD_S), gripper_open=True)
    try:
        MotionGuard(_widened(limits, now.position_m), before=now.pose()).check(ahead)
        check(ahead)
    except UnsafeActionError as error:
        return f"ahead {error.without_action()}"
    except MotionError as error:
        return str(error)
    return ""


def _widened(limits: MotionLimits, position_m: Array) -> MotionLimits:
    """Return the limits with a workspace that also contains the hand's position (3,)."""
    if limits.workspace is None:
        return limits
    low, high = np.minimum(limits.workspace.min_m, position_m), np.maximum(limits.workspace.max_m, position_m)
    return replace(limits, workspace=Box(tuple(low.tolist()), tuple(high.tolist())))
