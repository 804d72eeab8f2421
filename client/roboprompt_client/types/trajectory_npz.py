"""Trajectory <-> the .npz file that robots upload, and its JSON twin: named arrays, never a pickle."""

import io
import lzma
import struct
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, bounded_array, finite_array
from roboprompt_client.types.npy import array_from_npy
from roboprompt_client.types.trajectory import MAX_RAD, MAX_S, Trajectory

REQUIRED = ("end_effector_positions", "end_effector_quaternions_xyzw", "gripper_open")
_FIELDS = {  # in the file's order
    "joint_velocities": "joint_velocities_rad_s",
    "end_effector_positions": "positions_m",
    "end_effector_quaternions_xyzw": "quaternions_xyzw",
    "gripper_open": "gripper_open",
    "timestamps": "timestamps_s",
    "joint_positions": "joint_positions_rad",
    "object_positions": "object_positions_m",
    "object_quaternions_xyzw": "object_quaternions_xyzw",
    "gripper_width": "gripper_width_m",
    "wrenches": "wrenches_n_nm",
}
OPTIONAL = tuple(name for name in _FIELDS if name not in REQUIRED)
MIN_GRIPPER_TRAVEL_M = 0.005  # fingers that move less have neither opened nor closed
MAX_UNPACKED_BYTES = 100_000_000  # 600,000 frames; a .npz of 0.3 MB can claim 300 MB
MAX_FRAMES = 100_000  # 80 minutes at 20 Hz
MAX_DIRECTORY_BYTES = 131_072  # of the archive; 64 kB of them may be its comment
_VALID = f"a .npz file with the arrays {', '.join(REQUIRED)} (or gripper_width), and optionally {', '.join(OPTIONAL)}"


def trajectory_from_npz(
    data: bytes, max_unpacked_bytes: int = MAX_UNPACKED_BYTES, max_frames: int = MAX_FRAMES
) -> Trajectory:
    """The trajectory of a .npz file; pickles are never loaded.

    Raises:
        InvalidInputError: naming the array and what is wrong with it.
    """
    if not data:
        raise InvalidInputError("trajectory", "is empty", _VALID)
    try:
        file = _ShortDirectory(data)
        with zipfile.ZipFile(file) as archive:
            file.opened = True
            members = _unpack(archive, max_unpacked_bytes)
    except InvalidInputError:
        raise
    except _UNREADABLE as error:
        raise InvalidInputError("trajectory", f"is not a readable .npz file: {error}", _VALID) from None
    numbers = "a plain array of numbers"
    arrays = {name: array_from_npy(f"trajectory.{name}", member, numbers) for name, member in members.items()}
    return trajectory_from_arrays(arrays, max_frames)


# What zipfile raises for damaged archives; RuntimeError: encrypted, ValueError: offsets before the file's beginning.
_OF_ZIPFILE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error)
_UNREADABLE = (*_OF_ZIPFILE, EOFError, OSError, RuntimeError, ValueError, OverflowError)


class _ShortDirectory(io.BytesIO):
    """A file that `zipfile` cannot open if its directory is long: it would make an object of every entry first."""

    opened = False

    def read(self, size: int | None = -1) -> bytes:
        """The next bytes; while the file is being opened, not many at once."""
        if not self.opened and size is not None and size > MAX_DIRECTORY_BYTES:
            raise zipfile.BadZipFile(f"its directory has {size} bytes, at most {MAX_DIRECTORY_BYTES} are read")
        return super().read(size)


def _unpack(archive: zipfile.ZipFile, max_unpacked_bytes: int) -> dict[str, bytes]:
    members = archive.infolist()
    # each is unpacked as often as it is listed
    if len(members) > len(_FIELDS):
        raise InvalidInputError("trajectory", f"has {len(members)} arrays", _VALID)
    unpacked = sum(member.file_size for member in members)
    if unpacked > max_unpacked_bytes:
        raise InvalidInputError("trajectory", f"unpacks to {unpacked} bytes", f"at most {max_unpacked_bytes}")
    return {member.filename.removesuffix(".npy"): archive.read(member) for member in members}


def trajectory_from_arrays(arrays: Mapping[str, Any], max_frames: int = MAX_FRAMES) -> Trajectory:
    """The trajectory of named arrays.

    Raises:
        InvalidInputError: for missing or unknown names, or what Trajectory refuses.
    """
    given = {name: array for name, array in arrays.items() if array is not None}
    inferred = {"gripper_open"} if "gripper_width" in given else set()
    if missing := [name for name in REQUIRED if name not in given and name not in inferred]:
        raise InvalidInputError(f"trajectory.{missing[0]}", "is missing", _VALID)
    if unknown := [name for name in arrays if name not in _FIELDS]:
        raise InvalidInputError(f"trajectory.{unknown[0]}", "is not known", _VALID)
    gripper = "gripper_open" if "gripper_open" in given else "gripper_width"
    num_frames = len(finite_array(f"trajectory.{gripper}", given[gripper], (None,)))
    if num_frames > max_frames:
        raise InvalidInputError("trajectory", f"has {num_frames} frames", f"at most {max_frames}")
    if "joint_velocities" not in given:
        given["joint_velocities"] = _joint_velocities(num_frames, given.get("joint_positions"), given.get("timestamps"))
    if gripper == "gripper_width":
        given["gripper_open"] = _gripper_open(given["gripper_width"], num_frames)
    return Trajectory(**{_FIELDS[name]: array for name, array in given.items()})


def npz_from_trajectory(trajectory: Trajectory) -> bytes:
    """The inverse of `trajectory_from_npz`; the same trajectory gives the same bytes."""
    arrays: dict[str, Any] = {name: getattr(trajectory, field) for name, field in _FIELDS.items()}
    if trajectory.num_joints == 0:
        del arrays["joint_velocities"]
    stream = io.BytesIO()
    # in one order of memory, which the file would tell
    ordered: dict[str, Any] = {name: np.ascontiguousarray(array) for name, array in arrays.items() if array is not None}
    np.savez_compressed(stream, **ordered)
    return stream.getvalue()


def _joint_velocities(
    num_frames: int, joint_positions_rad: npt.ArrayLike | None, timestamps_s: npt.ArrayLike | None
) -> Array:
    """(T, J) rad/s, central differences of the positions; (T, 0) where there are none."""
    if joint_positions_rad is None:
        return np.zeros((num_frames, 0))
    positions = bounded_array("trajectory.joint_positions", joint_positions_rad, (num_frames, None), MAX_RAD, "rad")
    if timestamps_s is None:
        message = "is missing, and joint_positions have no timestamps from which it would follow"
        raise InvalidInputError("trajectory.joint_velocities", message, "(T, J) rad/s, or timestamps (T,) s")
    if num_frames < 2:
        return np.zeros_like(positions)
    times = bounded_array("trajectory.timestamps", timestamps_s, (num_frames,), MAX_S, "s")
    if (np.diff(times) <= 0).any():
        raise InvalidInputError("trajectory.timestamps", "do not increase", "increasing seconds")
    rates: Array = np.gradient(positions, times, axis=0)
    return rates


def _gripper_open(widths_m: npt.ArrayLike, num_frames: int) -> npt.NDArray[np.bool_]:
    """(T,) whether the fingers are further apart than the middle between their extremes, which must be apart."""
    widths = finite_array("trajectory.gripper_width", widths_m, (num_frames,))
    low, high = float(widths.min(initial=np.inf)), float(widths.max(initial=-np.inf))
    if high - low < MIN_GRIPPER_TRAVEL_M:
        message = f"stays at {low:.4f} to {high:.4f} m, and nothing says whether that is open"
        raise InvalidInputError("trajectory.gripper_width", message, "gripper_open (T,) beside it")
    opened: npt.NDArray[np.bool_] = widths > (low + high) / 2
    return opened
