"""The files of a recording: a journal of samples, and a film of each camera; a crash costs a second at most.

A journal has a line of JSON and then rows of little-endian float64: time, position, quaternion, gripper width, gripper
state, joint positions, joint velocities, wrench; NaN where a value is not known. A film has for each picture its time
(float64, by `time.monotonic`), its size (uint32), both little-endian, and the JPEG file.
"""

import json
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.film import Film
from roboprompt_client.types.gripper import MIN_TRAVEL_M
from roboprompt_client.types.trajectory import Trajectory, trajectory_from_arrays

WRITABLE = "a new file in a folder of this user's, on a disk with space"
OPEN_ABOVE_M = 0.01  # fingers that never move count as open above this width
MARK = ".film_"
_FIXED_COLUMNS = 10  # before those of the joints
_WRENCH = 6
_ENTRY = struct.Struct("<dI")


def create_private(path: Path) -> BinaryIO:
    """Return a new file that only this user may read; raises FileExistsError if `path` exists."""
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb")


def journal_head(state: ArmState, began_s: float) -> bytes:
    """Return the first line of a journal that begins with `state`."""
    joints = 0 if state.joint_positions_rad is None else len(state.joint_positions_rad)
    return json.dumps({"joints": joints, "wrench": _WRENCH, "began_s": began_s}).encode() + b"\n"


def journal_row(time_s: float, state: ArmState, num_joints: int) -> bytes:
    """Return a sample; the time counts from the first one."""
    parts = (
        ([time_s], 1),
        (state.position_m, 3),
        (state.quaternion_xyzw, 4),
        (None if state.gripper_width_m is None else [state.gripper_width_m], 1),
        (None if state.gripper_open is None else [float(state.gripper_open)], 1),
        (state.joint_positions_rad, num_joints),
        (state.joint_velocities_rad_s, num_joints),
        (state.wrench_n_nm, _WRENCH),
    )
    known = [np.full(length, np.nan) if values is None else values for values, length in parts]
    return np.concatenate(known).astype("<f8").tobytes()


def film_entry(taken_s: float, jpeg: bytes) -> bytes:
    """Return a picture as a film has it."""
    return _ENTRY.pack(taken_s, len(jpeg)) + jpeg


def film_file(journal: Path, camera: str) -> Path:
    """Return the path of a camera's film beside a journal."""
    return journal.with_name(f"{journal.name}{MARK}{camera}")


def film_files(journal: Path) -> list[Path]:
    """Return the films beside a journal."""
    return sorted(journal.parent.glob(f"{journal.name}{MARK}*"))


def trajectory_from_journal(path: Path) -> Trajectory:
    """Return a journal's trajectory, without a row that a crash cut off; raises InvalidInputError if it is invalid."""
    rows, head = _rows(path)
    if not len(rows):
        raise InvalidInputError("recording", f"{path} has no frames", "at least one")
    rows = rows[np.diff(rows[:, 0], prepend=-np.inf) > 0]
    widths_m, states = rows[:, 8], rows[:, 9]
    arrays = {
        "timestamps": rows[:, 0],
        "end_effector_positions": rows[:, 1:4],
        "end_effector_quaternions_xyzw": rows[:, 4:8],
        **_gripper(widths_m, states),
    }
    joints = int(head["joints"])
    positions, velocities, wrenches = np.split(rows[:, _FIXED_COLUMNS:], [joints, 2 * joints], axis=1)
    if joints:
        arrays["joint_positions"] = positions
    if joints and np.isfinite(velocities).all():
        arrays["joint_velocities"] = velocities
    if wrenches.size and np.isfinite(wrenches).all():
        arrays["wrenches"] = wrenches
    return trajectory_from_arrays(arrays)


def _gripper(widths_m: Array, states: Array) -> dict[str, Array]:
    """Return the measured width, else the commanded state; an arm without a gripper counts as open."""
    if not np.isfinite(widths_m).all():
        return {"gripper_open": np.where(np.isfinite(states), states, 1.0)}
    if float(np.ptp(widths_m)) >= MIN_TRAVEL_M:
        return {"gripper_width": widths_m}
    return {"gripper_width": widths_m, "gripper_open": (widths_m > OPEN_ABOVE_M).astype(np.float64)}


def films_from_journal(path: Path) -> tuple[Film, ...]:
    """Return the films beside a journal: the pictures that were taken during the recording, by its clock.

    Raises:
        InvalidInputError: if the journal is invalid.
    """
    rows, head = _rows(path)
    if not len(rows) or "began_s" not in head:
        return ()
    films = []
    for file in film_files(path):
        taken = [(time_s - float(head["began_s"]), jpeg) for time_s, jpeg in _entries(file.read_bytes())]
        if kept := [(time_s, jpeg) for time_s, jpeg in taken if 0 <= time_s <= rows[-1, 0]]:
            times_s, pictures = zip(*kept, strict=True)
            films.append(Film(file.name.partition(MARK)[2], np.array(times_s), pictures))
    return tuple(films)


def _entries(content: bytes) -> Iterator[tuple[float, bytes]]:
    """Yield the pictures with their times, without one that a crash cut off."""
    start = 0
    while start + _ENTRY.size <= len(content):
        time_s, size = _ENTRY.unpack_from(content, start)
        start += _ENTRY.size + size
        if start > len(content):
            return
        yield time_s, content[start - size : start]


def _rows(path: Path) -> tuple[Array, dict[str, Any]]:
    head, _, body = path.read_bytes().partition(b"\n")
    try:
        known = dict(json.loads(head))
        width = _FIXED_COLUMNS + 2 * int(known["joints"]) + int(known.get("wrench", 0))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InvalidInputError("recording", f"{path} is not a journal", "a file of roboprompt-robot record") from error
    return np.frombuffer(body, "<f8", count=len(body) // (8 * width) * width).reshape(-1, width), known
