"""What a recording leaves out and its other numbers say."""

import numpy as np
import numpy.typing as npt

from roboprompt_client.arrays import Array, finite_array
from roboprompt_client.errors import InvalidInputError

LEAST_TRAVEL_M = 0.005  # fingers that move less have neither opened nor closed


def joint_velocities(
    num_frames: int, joint_positions_rad: npt.ArrayLike | None, timestamps_s: npt.ArrayLike | None
) -> Array:
    """(T, J) rad/s, central differences of the positions; (T, 0) where there are none.

    Raises:
        InvalidInputError: if there are positions, but no times.
    """
    if joint_positions_rad is None:
        return np.zeros((num_frames, 0))
    positions = finite_array("trajectory.joint_positions", joint_positions_rad, (num_frames, None))
    if timestamps_s is None:
        message = "is missing, and joint_positions have no timestamps from which it would follow"
        raise InvalidInputError("trajectory.joint_velocities", message, "(T, J) rad/s, or timestamps (T,) s")
    if num_frames < 2:
        return np.zeros_like(positions)
    times = finite_array("trajectory.timestamps", timestamps_s, (num_frames,))
    if (np.diff(times) <= 0).any():
        raise InvalidInputError("trajectory.timestamps", "do not increase", "increasing seconds")
    rates: Array = np.gradient(positions, times, axis=0)
    return rates


def gripper_open(widths_m: npt.ArrayLike, num_frames: int) -> npt.NDArray[np.bool_]:
    """(T,) whether the fingers are further apart than the middle between their extremes.

    Raises:
        InvalidInputError: if they hardly move: nobody can tell then whether they are open or closed.
    """
    widths = finite_array("trajectory.gripper_width", widths_m, (num_frames,))
    low, high = float(widths.min(initial=np.inf)), float(widths.max(initial=-np.inf))
    if high - low < LEAST_TRAVEL_M:
        message = f"stays at {low:.4f} to {high:.4f} m, and nothing says whether that is open"
        raise InvalidInputError("trajectory.gripper_width", message, "gripper_open (T,) beside it")
    opened: npt.NDArray[np.bool_] = widths > (low + high) / 2
    return opened
