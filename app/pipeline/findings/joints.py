"""Whether the joints of a recording and its hand fit each other: units of the joints, and the hand's frame.

A Franka's joints tell where its hand is (the Panda and the Research 3 share one geometry). If base and tool can be
placed so that the hand's recorded positions follow from the joints, its recorded rotations must follow from them, too.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.findings.quaternion_order import likeliest_meaning, off_mean_deg
from app.pipeline.keyframes import Motion
from roboprompt_client.arms.panda import HAND_M, LIMITS_RAD, flange
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.trajectory import Trajectory

MAX_JOINT_RAD_S = 30.0  # several times the speed of an arm
FAST_JOINT_RAD_S = 2.0
MIN_JOINT_RAD_S = 0.05  # below this a rate from positions is mostly noise
MAX_RATE_RATIO = 20.0  # of joint velocities to the derivative of joint positions: 57 if they are in degrees
MIN_HAND_M_PER_RAD = 0.02  # the least motion of the hand for a joint's turn
MAX_JOINT_RAD = 4 * np.pi
FEW_FRAMES = 5

LOWEST_RAD = np.min([low for low, _ in LIMITS_RAD.values()], axis=0)
HIGHEST_RAD = np.max([high for _, high in LIMITS_RAD.values()], axis=0)
LIMIT_MARGIN_RAD = 0.05
COMPARED = 40  # frames of a recording
STEP_M, STEPS = 1e-4, 6
# Of the error of positions to the width of the path. Frankas: at most 0.028; other arms of seven joints: from 0.3 on
MAX_ERROR_SHARE = 0.05
MIN_WIDTH_M = 0.015  # a path nearer to a straight line does not tell how the base is turned
MUCH_BETTER = 2.0  # times less error has the frame with a reversed axis if the positions are in such a frame
MAX_TURN_DEG = 10.0  # of the tool on its flange; right recordings: at most 3.7
MAX_DOUBT_M = 0.005
POSITIONS, ROTATIONS = "trajectory.end_effector_positions", "trajectory.end_effector_quaternions_xyzw"


def check_joints(motion: Motion) -> None:
    """Refuse joints that are not in radians and rad/s, and a hand that contradicts a Franka's joints.

    Raises:
        InvalidInputError: naming the field and what the numbers probably are.
    """
    angles_rad, speeds_rad_s = motion.trajectory.joint_positions_rad, motion.joint_speeds_rad_s
    if angles_rad is not None and (most := float(np.abs(angles_rad).max())) > MAX_JOINT_RAD:
        raise InvalidInputError("trajectory.joint_positions", f"reaches {most:.4g}: likely degrees", "radians")
    fastest = float(speeds_rad_s.max())
    moving = speeds_rad_s > fastest / 10
    hand = motion.hand_speeds_m_s
    idle = float(np.median(hand[moving] / speeds_rad_s[moving])) < MIN_HAND_M_PER_RAD if fastest > 0 else False
    if fastest > MAX_JOINT_RAD_S or (fastest > FAST_JOINT_RAD_S and idle) or _beyond_positions(motion):
        message = f"reaches {fastest:.4g} (norm over the joints): likely degrees per second"
        raise InvalidInputError("trajectory.joint_velocities", message, "rad/s")
    _check_hand(motion.trajectory)


def _beyond_positions(motion: Motion) -> bool:
    """Return whether joint velocities are many times the derivative of the joint positions."""
    angles_rad = motion.trajectory.joint_positions_rad
    if angles_rad is None or len(motion) < FEW_FRAMES:
        return False
    shown_rad_s = np.linalg.norm(np.gradient(angles_rad, motion.times_s, axis=0), axis=1)
    moving = shown_rad_s > MIN_JOINT_RAD_S
    if not moving.any():
        return False
    return bool(np.median(motion.joint_speeds_rad_s[moving] / shown_rad_s[moving]) > MAX_RATE_RATIO)


def flange_away_m(trajectory: Trajectory) -> float | None:
    """Return how far a Franka's flange is from the recorded hand; None for other arms, or if the path hardly tells."""
    frames, flanges = _flanges(trajectory)
    if not len(frames):
        return None
    fitted = _fitted(flanges, trajectory.positions_m[frames])
    return fitted.tip_away_m if fitted.explains and fitted.doubt_m <= MAX_DOUBT_M else None


def _flanges(trajectory: Trajectory) -> tuple[npt.NDArray[np.intp], Array]:
    """Return frames (N,) and a Franka's flanges (N, 4, 4) there; no frames if the joints are not a Franka's."""
    angles_rad = trajectory.joint_positions_rad
    none = np.zeros(0, np.intp), np.zeros((0, 4, 4))
    if angles_rad is None or angles_rad.shape[1] != len(LOWEST_RAD) or len(trajectory) < FEW_FRAMES:
        return none
    if (angles_rad < LOWEST_RAD - LIMIT_MARGIN_RAD).any() or (angles_rad > HIGHEST_RAD + LIMIT_MARGIN_RAD).any():
        return none
    frames = np.unique(np.linspace(0, len(trajectory) - 1, COMPARED).round().astype(np.intp))
    return frames, np.array([flange(angles)[0] for angles in angles_rad[frames]])


def _check_hand(trajectory: Trajectory) -> None:
    """Refuse a left-handed frame, and rotations that do not turn with a Franka's joints."""
    frames, flanges = _flanges(trajectory)
    if not len(frames):
        return
    positions_m, quaternions = trajectory.positions_m[frames], trajectory.quaternions_xyzw[frames]
    fitted = _fitted(flanges, positions_m)
    if fitted.explains:
        _check_turns(Rotation.from_matrix(fitted.base @ flanges[:, :3, :3]), quaternions)
        return
    reversed_ = _fitted(flanges, -positions_m)  # three reversed axes are one, turned by half a turn
    if reversed_.explains and reversed_.error_m < fitted.error_m / MUCH_BETTER:
        message = "are where a Franka's joints put its hand only if one axis is reversed: a left-handed frame"
        raise InvalidInputError(POSITIONS, message, "a right-handed world frame, meters")


def _check_turns(flanges: Rotation, quaternions: Array) -> None:
    """Refuse a hand that turns on its flange."""

    def turns_deg(hands: Rotation) -> float:
        return float(off_mean_deg(flanges.inv() * hands).max())

    as_sent_deg = turns_deg(Rotation.from_quat(quaternions))
    if as_sent_deg <= MAX_TURN_DEG:
        return
    likely, meant_deg = likeliest_meaning(quaternions, turns_deg)
    why = f"; they would if they were {likely}" if meant_deg < MAX_TURN_DEG / 2 else ""
    message = f"turn by up to {as_sent_deg:.0f} degrees otherwise than a Franka's joints turn its hand{why}"
    raise InvalidInputError(ROTATIONS, message, "rotations of the hand in the world frame, order x y z w")


class _Fitted(NamedTuple):
    """A base and a tool that explain the positions.

    Attributes:
        base: (3, 3) the base's axes in the world.
        tip_away_m: distance of the tool's tip from the flange's origin.
        error_m: RMS distance of the tips from the positions.
        doubt_m: standard error of the tip along the direction that the path shows least.
        explains: whether it explains the positions, and few others do.
    """

    base: Array
    tip_away_m: float
    error_m: float
    doubt_m: float
    explains: bool


def _fitted(flanges: Array, positions_m: Array) -> _Fitted:
    """Return the fit with the least squares of distances.

    Args:
        flanges: (N, 4, 4) in the base frame, as the joints say.
        positions_m: (N, 3) of the hand in the world frame.
    """
    tip_m = np.array([0.0, 0.0, HAND_M])
    for _ in range(STEPS):  # Gauss-Newton
        _, _, off_m = _placed(flanges, tip_m, positions_m)
        moved = [_placed(flanges, tip_m + step_m, positions_m)[2] for step_m in STEP_M * np.eye(3)]
        slopes = np.stack([(item - off_m).ravel() / STEP_M for item in moved], axis=1)
        tip_m = tip_m - np.linalg.lstsq(slopes, off_m.ravel(), rcond=1e-3)[0]
    base, tips_m, off_m = _placed(flanges, tip_m, positions_m)
    widths_m = np.linalg.svd(tips_m, compute_uv=False) / np.sqrt(len(tips_m))  # along principal axes, the largest first
    error_m = float(np.sqrt((off_m**2).sum(axis=1).mean()))
    least = float(np.linalg.svd(slopes, compute_uv=False)[-1])
    explains = bool(widths_m[1] > MIN_WIDTH_M and error_m < MAX_ERROR_SHARE * widths_m[0])
    return _Fitted(base, float(np.linalg.norm(tip_m)), error_m, error_m / max(least, 1e-9), explains)


def _placed(flanges: Array, tip_m: Array, positions_m: Array) -> tuple[Array, Array, Array]:
    """Return the base's axes (3, 3) that put the tips of the flanges nearest to the hand's positions (Kabsch).

    With them the tips (N, 3) in the base frame, about their mean, and their way (N, 3) from the positions.
    """
    tips_m = flanges[:, :3, 3] + flanges[:, :3, :3] @ tip_m
    tips_m, wanted_m = tips_m - tips_m.mean(axis=0), positions_m - positions_m.mean(axis=0)
    left, _, right = np.linalg.svd(wanted_m.T @ tips_m)
    base = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
    return base, tips_m, tips_m @ base.T - wanted_m
