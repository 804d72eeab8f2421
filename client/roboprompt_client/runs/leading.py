"""Objects that move by themselves, e.g. on a belt: their velocity from two observations, and where they will be.

The velocity is taken as constant and horizontal until contact; rotation is not extrapolated.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from time import monotonic

import numpy as np

from roboprompt_client.errors import InvalidInputError, ObjectLostError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

MIN_LOOK_INTERVAL_S = 0.2  # between two observations: an estimator's noise of 1 cm would be 5 cm/s
MAX_SPEED_M_S = 0.15  # what is faster cannot be grasped by a motion that ends at rest
RESTING_M_S = 0.003
MAX_HEIGHT_CHANGE_M = 0.01  # an object that rises or sinks by more has left what carried it
MAX_LEAD_S = 10.0


class Leading:
    """Estimates objects' velocities, and where they will be `lead_s` after an observation.

    Args:
        lead_s: how long the robot takes from an observation until its fingers close.
        clock: seconds from any beginning; for simulations, whose time passes otherwise.

    Raises:
        InvalidInputError: if `lead_s` is no time above 0, or longer than 10 s.
    """

    def __init__(self, lead_s: float, clock: Callable[[], float] = monotonic) -> None:
        if not (math.isfinite(lead_s) and 0 < lead_s <= MAX_LEAD_S):
            raise InvalidInputError("lead_s", f"is {lead_s:g}", f"seconds above 0, {MAX_LEAD_S:g} at most")
        self._lead_s, self.clock = lead_s, clock
        self._seen: dict[str, tuple[ObjectPose, float]] = {}  # and when
        self._velocities_m_s: dict[str, Array] = {}

    def saw(self, poses: Mapping[str, ObjectPose], at_s: float) -> None:
        """Note an observation; one that follows another too closely is not used for the velocity.

        Raises:
            ObjectLostError: if an object has left what carried it, or is too fast.
        """
        for name, pose in poses.items():
            before, before_s = self._seen.get(name, (None, at_s))
            if before is None:
                self._seen[name] = pose, at_s
                continue
            along_x_m, along_y_m, up_m = pose.position_m - before.position_m
            if abs(up_m) > MAX_HEIGHT_CHANGE_M:
                raise ObjectLostError(name, f"it left what carried it: {100 * up_m:+.1f} cm in height")
            if at_s - before_s < MIN_LOOK_INTERVAL_S:
                continue
            velocity_m_s = np.array([along_x_m, along_y_m, 0.0]) / (at_s - before_s)
            self._velocities_m_s[name], self._seen[name] = velocity_m_s, (pose, at_s)
            if (speed_m_s := float(np.linalg.norm(velocity_m_s))) > MAX_SPEED_M_S:
                most = f"{100 * MAX_SPEED_M_S:.0f} cm/s at most can be led"
                raise ObjectLostError(name, f"it moves at {100 * speed_m_s:.0f} cm/s, {most}")

    def led(self, name: str, pose: ObjectPose) -> ObjectPose:
        """The pose where the object will be when the fingers close; one that rests stays."""
        velocity_m_s = self._velocities_m_s.get(name)
        if velocity_m_s is None or float(np.linalg.norm(velocity_m_s)) < RESTING_M_S:
            return pose
        return replace(pose, position_m=pose.position_m + self._lead_s * velocity_m_s)
