"""Joint paths -> jerk-limited joint positions and velocities at every control step.

From rest to rest by ruckig (`time_path`). Without rests: paths are joined into one route, their corners rounded, and it
is passed as quickly as asked and as the joints allow (`Pace`). The speed along the route first follows the limits of
speed and acceleration. A mean over a sliding window of time then limits the jerk to twice the acceleration divided by
the window; the route itself stays as it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import ruckig
from scipy.interpolate import CubicHermiteSpline, CubicSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.planner import JointPath, Kinematics
from roboprompt_client.types.arrays import Array

# Fractions of Franka's limits: brisk, and within what the position servos follow to a millimeter
VELOCITY_SHARE, FREE_ACCELERATION_SHARE, LINE_ACCELERATION_SHARE, JERK_SHARE = 0.5, 0.25, 0.3, 0.05
# Limits of the tool on a straight line; a turn of 1 rad counts as 0.3 m
LINE_VELOCITY_M_S, LINE_ACCELERATION_M_S2, LINE_JERK_M_S3 = 0.25, 0.8, 6.0
METERS_PER_RAD = 0.3
MIN_LINE_M = 1e-4
RATE_SAMPLES = 20

# Of routes
SAMPLE_M = 0.003
JOINT_METERS_PER_RAD = 0.1  # so that a change of posture with the tool at rest has a length, too
MIN_SAMPLE_M = 1e-6
MIN_LEG_SAMPLES = 9
# Around a corner the mean over a window this many times as wide as the distance allowed stays within it: a mean over
# half a window h to either side of a corner that turns back on itself is h / 2 away from it.
WINDOW_PER_DISTANCE = 2.0
ACCELERATION_M_S2 = 0.6
# Fractions of Franka's limits of acceleration, for bends and for changes of speed: the servos follow to a millimeter
BEND_SHARE, CHANGE_SHARE = 0.15, 0.2
WINDOW_S = 0.2
NEGLIGIBLE = 1e-9


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Joint positions and velocities (N, 7) in rad and rad/s, one row a control step; the last row is at rest."""

    positions_rad: Array
    velocities_rad_s: Array


def time_path(path: JointPath, kinematics: Kinematics, step_s: float) -> JointMotion:
    """The motion along a path from rest to rest, sampled every `step_s`."""
    return _along_line(path, kinematics, step_s) if path.straight else _free(path, step_s)


def _free(path: JointPath, step_s: float) -> JointMotion:
    positions, velocities = _ruckig(
        start=path.joints_rad[0],
        end=path.end_rad,
        velocity=VELOCITY_SHARE * panda.MAX_VELOCITY_RAD_S,
        acceleration=FREE_ACCELERATION_SHARE * panda.MAX_ACCELERATION_RAD_S2,
        jerk=JERK_SHARE * panda.MAX_JERK_RAD_S3,
        step_s=step_s,
    )
    return JointMotion(positions, velocities)


def _along_line(path: JointPath, kinematics: Kinematics, step_s: float) -> JointMotion:
    """One parameter from 0 to 1 runs along a spline through the line's points, limited by tool and joints."""
    spline = CubicSpline(np.linspace(0, 1, len(path.joints_rad)), path.joints_rad, bc_type="natural")
    rate = np.abs(spline(np.linspace(0, 1, RATE_SAMPLES), 1)).max(axis=0) + 1e-9
    apart_m, turn_rad = kinematics.forward(path.joints_rad[0]).apart(kinematics.forward(path.end_rad))
    length_m = max(apart_m, METERS_PER_RAD * turn_rad, MIN_LINE_M)
    parameter, speed = _ruckig(
        start=np.zeros(1),
        end=np.ones(1),
        velocity=min(LINE_VELOCITY_M_S / length_m, (VELOCITY_SHARE * panda.MAX_VELOCITY_RAD_S / rate).min()),
        acceleration=min(
            LINE_ACCELERATION_M_S2 / length_m, (LINE_ACCELERATION_SHARE * panda.MAX_ACCELERATION_RAD_S2 / rate).min()
        ),
        jerk=min(LINE_JERK_M_S3 / length_m, (JERK_SHARE * panda.MAX_JERK_RAD_S3 / rate).min()),
        step_s=step_s,
    )
    return JointMotion(spline(parameter[:, 0]), spline(parameter[:, 0], 1) * speed)


def _ruckig(
    *,
    start: Array,
    end: Array,
    velocity: npt.ArrayLike,
    acceleration: npt.ArrayLike,
    jerk: npt.ArrayLike,
    step_s: float,
) -> tuple[Array, Array]:
    """Time-optimal positions and velocities (N, D) from rest to rest under symmetric limits."""
    size = len(start)
    problem = ruckig.InputParameter(size)
    problem.current_position, problem.target_position = start.tolist(), end.tolist()
    problem.max_velocity = np.broadcast_to(velocity, size).tolist()
    problem.max_acceleration = np.broadcast_to(acceleration, size).tolist()
    problem.max_jerk = np.broadcast_to(jerk, size).tolist()
    solution = ruckig.Trajectory(size)
    result = ruckig.Ruckig(size).calculate(problem, solution)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise RuntimeError(f"ruckig found no trajectory from {start} to {end}: {result}")
    times = np.append(np.arange(step_s, solution.duration, step_s), solution.duration)
    samples = [solution.at_time(time)[:2] for time in times]
    positions = np.array([np.atleast_1d(position) for position, _ in samples])
    velocities = np.array([np.atleast_1d(speed) for _, speed in samples])
    return positions, velocities


@dataclass(frozen=True, eq=False)
class Route:
    """Joint positions to pass, from one rest to the next.

    Attributes:
        joints_rad: (K, 7).
        along_m: (K,) increasing from 0: the way until there; a turn of the tool by 1 rad counts as 0.3 m.
        ends_m: where along the route each of its paths ends; the last is its length.
    """

    joints_rad: Array
    along_m: Array
    ends_m: tuple[float, ...]

    @property
    def length_m(self) -> float:
        """From end to end."""
        return self.ends_m[-1]


def joined(paths: Sequence[JointPath], within_m: Sequence[float], kinematics: Kinematics) -> Route:
    """The paths as one route.

    Args:
        within_m: for the end of every path but the last, how far the route may pass from it.
    """
    legs = [_sampled(path, kinematics) for path in paths]
    lengths_m = [steps.sum() for _, steps in legs]
    joints = np.concatenate([legs[0][0][:1], *(leg[1:] for leg, _ in legs)])
    along_m = np.concatenate([[0.0], np.cumsum(np.concatenate([steps for _, steps in legs]))])
    ends_m = np.cumsum(lengths_m)
    half_windows_m = np.zeros(len(along_m))
    for index, distance_m in enumerate(within_m):
        half_m = min(WINDOW_PER_DISTANCE * distance_m, lengths_m[index] / 2, lengths_m[index + 1] / 2)
        # Beyond the corner's reach the window shrinks to nothing, so that the ends of the legs stay where they are.
        tapered = np.clip(2 * half_m - np.abs(along_m - ends_m[index]), 0, half_m)
        half_windows_m = np.maximum(half_windows_m, tapered)
    return Route(_averaged(joints, along_m, half_windows_m), along_m, tuple(ends_m.tolist()))


def _sampled(path: JointPath, kinematics: Kinematics) -> tuple[Array, Array]:
    """Joint positions (N, 7) every few millimeters, and the ways (N - 1,) between them."""
    rough_m = _steps_m(path.joints_rad, kinematics).sum()
    share = np.linspace(0, 1, max(MIN_LEG_SAMPLES, int(np.ceil(rough_m / SAMPLE_M)) + 1))
    known = np.linspace(0, 1, len(path.joints_rad))
    if path.straight:
        joints = CubicSpline(known, path.joints_rad, bc_type="natural")(share)
    else:
        joints = make_interp_spline(known, path.joints_rad, k=1)(share)
    return joints, _steps_m(joints, kinematics)


def _steps_m(joints_rad: Array, kinematics: Kinematics) -> Array:
    poses = [kinematics.forward(joints) for joints in joints_rad]
    shifts_m = np.linalg.norm(np.diff([pose.position_m for pose in poses], axis=0), axis=1)
    rotations = Rotation.concatenate([pose.rotation for pose in poses])
    turns_rad = (rotations[:-1].inv() * rotations[1:]).magnitude()
    bends_rad = np.abs(np.diff(joints_rad, axis=0)).max(axis=1)
    steps: Array = np.max(
        [shifts_m, METERS_PER_RAD * turns_rad, JOINT_METERS_PER_RAD * bends_rad, np.full(len(bends_rad), MIN_SAMPLE_M)],
        axis=0,
    )
    return steps


def _averaged(joints_rad: Array, along_m: Array, half_windows_m: Array) -> Array:
    """The joint positions, each the mean over its window to either side; a straight stretch stays as it is."""
    integral = make_interp_spline(along_m, joints_rad, k=1).antiderivative()
    wide = half_windows_m > MIN_SAMPLE_M
    at_m, half_m = along_m[wide], half_windows_m[wide]
    averaged = joints_rad.copy()
    averaged[wide] = (integral(at_m + half_m) - integral(at_m - half_m)) / (2 * half_m)[:, None]
    return averaged


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
