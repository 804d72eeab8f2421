"""Whether a Franka arm gets from where it is to a pose, in a straight line and within its joints' limits.

Geometry and limits: Franka Robotics, "Robot and interface specifications" (Denavit-Hartenberg, Craig's convention; the
Panda and the Research 3 share the geometry).
"""

import numpy as np

from roboprompt_client import quaternions as rotations
from roboprompt_client.arrays import Array
from roboprompt_client.errors import MotionError

_A_M = (0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088)
_D_M = (0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0)
_ALPHA_RAD = (0.0, -np.pi / 2, np.pi / 2, np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2)
_FLANGE_M = 0.107
LIMITS_RAD = {
    "panda": (
        (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
        (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
    ),
    "fr3": (
        (-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159),
        (2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159),
    ),
}
MARGIN_RAD = 0.02  # the arm's own reflex comes at the limit
REACH_M = 0.855  # of the flange from the shoulder
SHOULDER_M = np.array([0.0, 0.0, 0.333])
STEP_M, STEP_RAD = 0.01, 0.05
NEAR = 1e-4  # metres and radians
DAMPING, MOST_ITERATIONS = 0.02, 60


def flange(joints_rad: Array) -> tuple[Array, Array]:
    """The flange in the base frame (4, 4), and the Jacobian (6, 7) of its linear and angular velocity."""
    frames, frame = [], np.eye(4)
    for a, d, alpha, angle in zip(_A_M, _D_M, _ALPHA_RAD, joints_rad, strict=True):
        frame = frame @ _link(a, d, alpha, float(angle))
        frames.append(frame)
    frame = frame @ _link(0.0, _FLANGE_M, 0.0, 0.0)
    axes = np.array([item[:3, 2] for item in frames])
    arms = frame[:3, 3] - np.array([item[:3, 3] for item in frames])
    return frame, np.concatenate([np.cross(axes, arms), axes], axis=1).T


def check_way(joints_rad: Array, flange_to_tip: Array, position_m: Array, quaternion_xyzw: Array, model: str) -> Array:
    """The joints (7,) at the end of the straight way to a pose of the tip.

    Args:
        joints_rad: (7,) where the arm is.
        flange_to_tip: (4, 4) tip to flange.
        model: `panda` or `fr3`.

    Raises:
        MotionError: if the pose is beyond the arm's reach, or the way leads to a joint's limit, naming it.
    """
    target = np.eye(4)
    target[:3, :3], target[:3, 3] = rotations.to_matrix(quaternion_xyzw), position_m
    goal = target @ np.linalg.inv(flange_to_tip)
    away_m = float(np.linalg.norm(goal[:3, 3] - SHOULDER_M))
    if away_m > REACH_M:
        raise MotionError(f"the pose is out of reach: {away_m:.3f} m from the shoulder, at most {REACH_M} m")
    start, _ = flange(joints_rad)
    turn = rotations.to_rotation_vector(rotations.from_matrix(goal[:3, :3] @ start[:3, :3].T))
    way_m, way_rad = float(np.linalg.norm(goal[:3, 3] - start[:3, 3])), float(np.linalg.norm(turn))
    steps = max(1, int(np.ceil(max(way_m / STEP_M, way_rad / STEP_RAD))))
    low, high = (np.array(bound) for bound in LIMITS_RAD[model])
    joints = np.array(joints_rad, float)
    for part in np.arange(1, steps + 1) / steps:
        between = np.eye(4)
        between[:3, :3] = rotations.to_matrix(rotations.from_rotation_vector(part * turn)) @ start[:3, :3]
        between[:3, 3] = start[:3, 3] + part * (goal[:3, 3] - start[:3, 3])
        joints = _follow(joints, between, float(part))
        _check_limits(joints, low + MARGIN_RAD, high - MARGIN_RAD, float(part))
    return joints


def _follow(joints_rad: Array, goal: Array, part: float) -> Array:
    joints = joints_rad
    for _ in range(MOST_ITERATIONS):
        here, jacobian = flange(joints)
        turn = rotations.to_rotation_vector(rotations.from_matrix(goal[:3, :3] @ here[:3, :3].T))
        error = np.concatenate([goal[:3, 3] - here[:3, 3], turn])
        if np.abs(error).max() < NEAR:
            return joints
        joints = joints + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + DAMPING**2 * np.eye(6), error)
    raise MotionError(f"the pose is out of reach: the straight way to it ends after {100 * part:.0f} %")


def _check_limits(joints_rad: Array, low_rad: Array, high_rad: Array, part: float) -> None:
    for number, (angle, low, high) in enumerate(zip(joints_rad, low_rad, high_rad, strict=True), 1):
        if not low <= angle <= high:
            bound = f"{low:.3f} to {high:.3f} rad"
            where = f"after {100 * part:.0f} % of the way"
            raise MotionError(f"joint {number} would come to {angle:.3f} rad {where} (allowed: {bound})")


def _link(a_m: float, d_m: float, alpha_rad: float, angle_rad: float) -> Array:
    """One joint's frame in the one before (Craig's convention)."""
    ca, sa, ct, st = np.cos(alpha_rad), np.sin(alpha_rad), np.cos(angle_rad), np.sin(angle_rad)
    return np.array(
        [
            [ct, -st, 0.0, a_m],
            [st * ca, ct * ca, -sa, -d_m * sa],
            [st * sa, ct * sa, ca, d_m * ca],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
