"""When a motion without rests is where along its route: as quick as asked and as the joints allow, jerk-limited.

The speed along the route first follows the limits of speed and acceleration. A mean over a sliding window of time then
limits the jerk to twice the acceleration divided by the window; the route itself stays as it is.
"""

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from app.pipeline.arrays import Array
from app.sim import panda
from app.sim.motion import VELOCITY_SHARE, JointMotion
from app.sim.route import Route

ACCELERATION_M_S2 = 0.6
# Fractions of Franka's limits of acceleration, for bends and for changes of speed: the servos follow to a millimetre
BEND_SHARE, CHANGE_SHARE = 0.15, 0.2
WINDOW_S = 0.2
NEGLIGIBLE = 1e-9


class Pace:
    """The motion along a route, from rest to rest.

    Args:
        asked_m_s: (K,) the speed asked for at each of the route's points.

    Attributes:
        motion: one row a control step; begins with the route's first point and ends at its last.
    """

    def __init__(self, route: Route, asked_m_s: Array, step_s: float) -> None:
        curve = CubicSpline(route.along_m, route.joints_rad)
        speeds = _speeds(route.along_m, curve, asked_m_s)
        self._along_m, speed = _over_time(route.along_m, speeds, step_s)
        self.motion = JointMotion(curve(self._along_m), curve(self._along_m, 1) * speed[:, None])

    def row_at(self, along_m: float) -> int:
        """The first row of the motion that is as far along the route."""
        return int(np.searchsorted(self._along_m, along_m - NEGLIGIBLE))


def _speeds(along_m: Array, curve: CubicSpline, asked_m_s: Array) -> Array:
    """(K,) the highest speeds that respect every limit and begin and end with 0."""
    slope, bend = np.abs(curve(along_m, 1)) + NEGLIGIBLE, np.abs(curve(along_m, 2)) + NEGLIGIBLE
    by_joints = (VELOCITY_SHARE * panda.MAX_VELOCITY_RAD_S / slope).min(axis=1)
    in_bends = np.sqrt((BEND_SHARE * panda.MAX_ACCELERATION_RAD_S2 / bend).min(axis=1))
    squared = np.minimum.reduce([asked_m_s, by_joints, in_bends]) ** 2
    by_acceleration = (CHANGE_SHARE * panda.MAX_ACCELERATION_RAD_S2 / slope).min(axis=1)
    gain = 2 * np.minimum(ACCELERATION_M_S2, by_acceleration)[:-1] * np.diff(along_m)
    squared[[0, -1]] = 0.0
    for k in range(1, len(squared)):
        squared[k] = min(squared[k], squared[k - 1] + gain[k - 1])
    for k in range(len(squared) - 2, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + gain[k])
    speeds: Array = np.sqrt(squared)
    return speeds


def _over_time(along_m: Array, speeds_m_s: Array, step_s: float) -> tuple[Array, Array]:
    """Where along the route (N,) and how quick (N,) at every step, after the sliding mean."""
    times_s = np.concatenate([[0.0], np.cumsum(2 * np.diff(along_m) / (speeds_m_s[:-1] + speeds_m_s[1:]))])
    uniformly_accelerated = CubicHermiteSpline(times_s, along_m, speeds_m_s)
    window = round(WINDOW_S / step_s)
    steps = int(np.ceil(times_s[-1] / step_s)) + 1
    at = uniformly_accelerated(np.minimum(np.arange(steps) * step_s, times_s[-1]))
    padded = np.concatenate([np.full(window, along_m[0]), at, np.full(window, along_m[-1])])
    total = np.concatenate([[0.0], np.cumsum(padded)])
    mean = (total[window:] - total[:-window]) / window
    return mean, np.gradient(mean, step_s)
