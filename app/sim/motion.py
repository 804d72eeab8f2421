"""Joint paths -> jerk-limited joint positions and velocities at every control step, by ruckig."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import ruckig
from scipy.interpolate import CubicSpline

from app.sim import panda
from app.sim.kinematics import Kinematics
from app.sim.planner import JointPath
from roboprompt_client.arrays import Array

# Fractions of Franka's limits: brisk, and within what the position servos follow to a millimeter
VELOCITY_SHARE, FREE_ACCELERATION_SHARE, LINE_ACCELERATION_SHARE, JERK_SHARE = 0.5, 0.25, 0.3, 0.05
# Limits of the tool on a straight line; a turn of 1 rad counts as 0.3 m
LINE_VELOCITY_M_S, LINE_ACCELERATION_M_S2, LINE_JERK_M_S3 = 0.25, 0.8, 6.0
METRES_PER_RAD = 0.3
MIN_LINE_M = 1e-4
RATE_SAMPLES = 20


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
    length_m = max(apart_m, METRES_PER_RAD * turn_rad, MIN_LINE_M)
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
