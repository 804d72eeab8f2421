"""Whether a hand that a person steers may go on."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from roboprompt_client.arms.driver import STEERED_S, ArmState
from roboprompt_client.arrays import Array
from roboprompt_client.errors import MotionError, UnsafeActionError
from roboprompt_client.motion_guard import MotionGuard
from roboprompt_client.motion_limits import Box, MotionLimits
from roboprompt_client.trajectory import EndEffectorAction

Steer = Callable[[Array, Array], str]
BRAKING_S = 0.25
AHEAD_S = STEERED_S + BRAKING_S  # what is passed before the hand rests


def problem_ahead(
    now: ArmState,
    velocity_m_s: Array,
    turning_rad_s: Array,
    limits: MotionLimits,
    check: Callable[[EndEffectorAction], None],
) -> str:
    """Why the hand must rest; empty: it may go on. A hand outside of the workspace may come back into it.

    Args:
        now, velocity_m_s, turning_rad_s: in the world frame, (3,) both.
        check: raises MotionError for a pose that the arm does not reach.
    """
    if not (velocity_m_s.any() or turning_rad_s.any()):
        return ""
    ahead = EndEffectorAction(*now.moved(velocity_m_s, turning_rad_s, AHEAD_S), gripper_open=True)
    try:
        MotionGuard(_widened(limits, now.position_m), before=now.pose()).check(ahead)
        check(ahead)
    except UnsafeActionError as error:
        return f"ahead {error.field.partition('.')[2]} {error.message} (allowed: {error.bound})"
    except MotionError as error:
        return str(error)
    return ""


def _widened(limits: MotionLimits, position_m: Array) -> MotionLimits:
    """The same, its workspace as large as to have the hand in it."""
    if limits.workspace is None:
        return limits
    low, high = np.minimum(limits.workspace.min_m, position_m), np.maximum(limits.workspace.max_m, position_m)
    return replace(limits, workspace=Box(tuple(low.tolist()), tuple(high.tolist())))
