"""Trajectory <-> the .npz file that robots upload, and its JSON twin: named arrays, never a pickle."""

import io
import lzma
import struct
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from app.pipeline.arrays import finite_array
from app.pipeline.episode import Trajectory
from app.pipeline.errors import InvalidInputError
from app.pipeline.npy import array_from_npy

REQUIRED = ("joint_velocities", "end_effector_positions", "end_effector_quaternions_xyzw", "gripper_open")
OPTIONAL = ("timestamps", "joint_positions", "object_positions", "object_quaternions_xyzw")
MAX_UNPACKED_BYTES = 100_000_000  # 600,000 frames; a .npz of 0.3 MB can claim 300 MB
MAX_FRAMES = 100_000  # 80 minutes at 20 Hz
MAX_DIRECTORY_BYTES = 131_072  # of the archive; 64 kB of them may be its comment
_VALID = f"a .npz file with the arrays {', '.join(REQUIRED)}, and optionally {', '.join(OPTIONAL)}"


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
_UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    OSError,
    RuntimeError,
    ValueError,
    OverflowError,
)


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
    if len(members) > len(REQUIRED + OPTIONAL):
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
    if missing := [name for name in REQUIRED if arrays.get(name) is None]:
        raise InvalidInputError(f"trajectory.{missing[0]}", "is missing", _VALID)
    if unknown := [name for name in arrays if name not in REQUIRED + OPTIONAL]:
        raise InvalidInputError(f"trajectory.{unknown[0]}", "is not known", _VALID)
    num_frames = len(finite_array("trajectory.gripper_open", arrays["gripper_open"], (None,)))
    if num_frames > max_frames:
        raise InvalidInputError("trajectory", f"has {num_frames} frames", f"at most {max_frames}")
    return Trajectory(
        joint_velocities_rad_s=arrays["joint_velocities"],
        positions_m=arrays["end_effector_positions"],
        quaternions_xyzw=arrays["end_effector_quaternions_xyzw"],
        gripper_open=arrays["gripper_open"],
        timestamps_s=arrays.get("timestamps"),
        joint_positions_rad=arrays.get("joint_positions"),
        object_positions_m=arrays.get("object_positions"),
        object_quaternions_xyzw=arrays.get("object_quaternions_xyzw"),
    )


def npz_from_trajectory(trajectory: Trajectory) -> bytes:
    """The inverse of `trajectory_from_npz`; the same trajectory gives the same bytes."""
    arrays: dict[str, Any] = {
        "joint_velocities": trajectory.joint_velocities_rad_s,
        "end_effector_positions": trajectory.positions_m,
        "end_effector_quaternions_xyzw": trajectory.quaternions_xyzw,
        "gripper_open": trajectory.gripper_open,
        "timestamps": trajectory.timestamps_s,
        "joint_positions": trajectory.joint_positions_rad,
        "object_positions": trajectory.object_positions_m,
        "object_quaternions_xyzw": trajectory.object_quaternions_xyzw,
    }
    stream = io.BytesIO()
    # in one order of memory, which the file would tell
    ordered: dict[str, Any] = {name: np.ascontiguousarray(array) for name, array in arrays.items() if array is not None}
    np.savez_compressed(stream, **ordered)
    return stream.getvalue()
