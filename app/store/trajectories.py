"""A Trajectory <-> one compressed blob; every float64 comes back bit for bit.

Layout: `_HEADER` (magic, T, which optional arrays follow), then zlib of a (channels, T) float64 matrix whose bytes are
regrouped by significance: all first bytes, all second bytes, and so on. Neighbouring frames share their high bytes.

Measured on 16 recorded simulated episodes, 35.4 kB raw per 200 frames: 28.1 kB in 0.4 ms; .npz (deflate) 33.8 kB in
1.6 ms; lzma 27.3 kB in 6.4 ms; zlib level 9 1 % smaller, twice the time. Values that were float32 once: 13.8 kB.
"""

import struct
import zlib

import numpy as np

from app.pipeline.episode import NUM_JOINTS, Array, Trajectory
from app.store.errors import CorruptDataError

_MAGIC = b"RPT1"
_HEADER = struct.Struct("<4sIB")
_HAS_TIMESTAMPS = 1
_HAS_JOINT_POSITIONS = 2
_LEVEL = 1
_FLOAT64 = np.dtype("<f8")


def pack(trajectory: Trajectory) -> bytes:
    """The blob of `trajectory`; `unpack` is its inverse."""
    channels = [
        trajectory.joint_velocities_rad_s.T,
        trajectory.positions_m.T,
        trajectory.quaternions_xyzw.T,
        trajectory.gripper_open[None],
    ]
    flags = 0
    if trajectory.timestamps_s is not None:
        flags |= _HAS_TIMESTAMPS
        channels.append(trajectory.timestamps_s[None])
    if trajectory.joint_positions_rad is not None:
        flags |= _HAS_JOINT_POSITIONS
        channels.append(trajectory.joint_positions_rad.T)
    matrix = np.ascontiguousarray(np.concatenate(channels), dtype=_FLOAT64)
    by_significance = matrix.view(np.uint8).reshape(-1, _FLOAT64.itemsize).T.tobytes()
    return _HEADER.pack(_MAGIC, len(trajectory), flags) + zlib.compress(by_significance, _LEVEL)


def unpack(blob: bytes, episode_id: str) -> Trajectory:
    """The Trajectory that `pack` was given.

    Raises:
        CorruptDataError: naming `episode_id`, if the blob is damaged or of an unknown layout.
    """
    try:
        magic, num_frames, flags = _HEADER.unpack_from(blob)
        by_significance = zlib.decompress(blob[_HEADER.size :])
    except (struct.error, zlib.error) as error:
        raise CorruptDataError("trajectory", episode_id, str(error)) from error
    if magic != _MAGIC or flags & ~(_HAS_TIMESTAMPS | _HAS_JOINT_POSITIONS):
        raise CorruptDataError("trajectory", episode_id, f"unknown layout {magic!r}, flags {flags}")
    widths = _channel_widths(flags)
    expected_size = num_frames * sum(widths.values()) * _FLOAT64.itemsize
    if len(by_significance) != expected_size:
        raise CorruptDataError("trajectory", episode_id, f"{len(by_significance)} bytes instead of {expected_size}")
    octets = np.frombuffer(by_significance, np.uint8).reshape(_FLOAT64.itemsize, -1).T
    matrix = np.ascontiguousarray(octets).view(_FLOAT64).reshape(-1, num_frames)
    channels = np.split(matrix, np.cumsum(list(widths.values()))[:-1])
    return _restored(dict(zip(widths, channels, strict=True)))


def _channel_widths(flags: int) -> dict[str, int]:
    widths = {"joint_velocities_rad_s": NUM_JOINTS, "positions_m": 3, "quaternions_xyzw": 4, "gripper_open": 1}
    if flags & _HAS_TIMESTAMPS:
        widths["timestamps_s"] = 1
    if flags & _HAS_JOINT_POSITIONS:
        widths["joint_positions_rad"] = NUM_JOINTS
    return widths


def _restored(channels: dict[str, Array]) -> Trajectory:
    timestamps, joint_positions = channels.get("timestamps_s"), channels.get("joint_positions_rad")
    return Trajectory(
        joint_velocities_rad_s=channels["joint_velocities_rad_s"].T,
        positions_m=channels["positions_m"].T,
        quaternions_xyzw=channels["quaternions_xyzw"].T,
        gripper_open=channels["gripper_open"][0].astype(np.bool_),
        timestamps_s=None if timestamps is None else timestamps[0],
        joint_positions_rad=None if joint_positions is None else joint_positions.T,
    )
