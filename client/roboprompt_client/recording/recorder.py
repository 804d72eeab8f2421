"""Record an arm's state while a person moves it, and film it; each sample is on disk within a second."""

import json
import threading
import time
from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.cameras.rig import MountedCamera
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.recording.filming import Filming, film_files, film_from_file
from roboprompt_client.recording.private import create_private
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.film import FILM_HZ, Film
from roboprompt_client.types.trajectory import Trajectory
from roboprompt_client.types.trajectory_npz import MIN_GRIPPER_TRAVEL_M, trajectory_from_arrays

RATE_HZ = 50.0
MIN_RATE_HZ, MAX_RATE_HZ = 20.0, 1000.0
MAX_FILM_HZ = 60.0
FLUSH_S = 1.0
WRITABLE = "a new file in a folder of this user's, on a disk with space"
OPEN_ABOVE_M = 0.01  # fingers that never move count as open above this width
_FIXED_COLUMNS = 10  # time, position, quaternion, width, open; joint positions, joint velocities and wrench follow
WRENCH = 6


class Progress(NamedTuple):
    """A recording so far: number of frames, duration, and the arm's last state."""

    frames: int
    elapsed_s: float
    state: ArmState

    @property
    def rate_hz(self) -> float:
        """The sampling rate that was reached."""
        return (self.frames - 1) / self.elapsed_s if self.elapsed_s else 0.0


class HasState(Protocol):
    """A robot that can be recorded, such as an `Arm`."""

    def state(self) -> ArmState:
        """Return the arm's present state in the world frame; called from another thread."""
        ...


class Recorder:
    """Samples an arm in a thread, and writes the samples to a journal file.

        recorder = Recorder(arm, Path("pick-1.journal"), cameras=arm.cameras.cameras)
        recorder.start()
        input("Guide the arm, then press Enter: ")
        trajectory = recorder.stop()
        client.upload("pick", "pick up the cube", trajectory, observation, films=recorder.films)

    Args:
        journal: path of a new file; `trajectory_from_journal` reads it, also after a crash.
        rate_hz: at least 20.
        cameras: film the recording, such as those of an Arm's `cameras`; nothing else may use them meanwhile.
        film_hz: pictures a second; a camera may be slower. 0: no film.

    Raises:
        InvalidInputError: for a rate out of range, or a journal that exists.
    """

    def __init__(
        self,
        arm: HasState,
        journal: Path,
        rate_hz: float = RATE_HZ,
        cameras: Iterable[MountedCamera] = (),
        film_hz: float = FILM_HZ,
    ) -> None:
        checked_film_hz(film_hz)
        if journal.exists():
            raise InvalidInputError("journal", f"{journal} exists", "a new file for each recording")
        self._arm, self._journal, self._period_s = arm, journal, 1 / checked_rate_hz(rate_hz)
        self._cameras, self._film_hz, self._films = tuple(cameras) if film_hz else (), film_hz, list[Filming]()
        self._ended = threading.Event()
        self._progress: Progress | None = None
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    def start(self) -> None:
        """Begin to sample and to film."""
        self._thread.start()
        self._films = [Filming(camera, self._journal, self._film_hz) for camera in self._cameras]

    @property
    def progress(self) -> Progress | None:
        """The recording so far; None before the first sample. Raises as `stop` after the arm or the journal failed."""
        if self._error is not None:
            raise self._error
        return self._progress

    def stop(self) -> Trajectory:
        """Stop sampling, and return the trajectory.

        Raises:
            MotionError: if the arm stopped answering; the journal has the samples until then.
            InvalidInputError: if the samples are not a valid trajectory, or could not be written.
        """
        self._ended.set()
        self._thread.join()
        for film in self._films:
            film.stop()
        if self._error is not None:
            raise self._error
        return trajectory_from_journal(self._journal)

    @property
    def films(self) -> tuple[Film, ...]:
        """What the cameras took, after `stop`; none of a camera that took nothing."""
        return films_from_journal(self._journal)

    def _run(self) -> None:
        try:
            self._sample()
        except MotionError as error:
            self._error = error
        except OSError as error:
            self._error = InvalidInputError("journal", f"cannot be written: {error}", WRITABLE)

    def _sample(self) -> None:
        began_s, state = self._read()
        joints = 0 if state.joint_positions_rad is None else len(state.joint_positions_rad)
        with create_private(self._journal) as file:
            file.write(json.dumps({"joints": joints, "wrench": WRENCH, "began_s": began_s}).encode() + b"\n")
            flushed_s = due_s = seen_s = began_s
            for frames in count(1):  # at least one sample
                self._progress = Progress(frames, seen_s - began_s, state)
                file.write(_row(seen_s - began_s, state, joints).tobytes())
                if seen_s - flushed_s > FLUSH_S:
                    file.flush()
                    flushed_s = seen_s
                due_s = max(due_s + self._period_s, seen_s)
                if self._ended.wait(due_s - time.monotonic()):
                    return
                seen_s, state = self._read()

    def _read(self) -> tuple[float, ArmState]:
        """Return the state, and its time: the middle between request and answer."""
        asked_s = time.monotonic()
        state = self._arm.state()
        return (asked_s + time.monotonic()) / 2, state


def checked_rate_hz(rate_hz: float) -> float:
    """Return a sampling rate; raises InvalidInputError if it is out of range."""
    if MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ:
        return rate_hz
    raise InvalidInputError("rate_hz", f"is {rate_hz:g}", f"{MIN_RATE_HZ:g} to {MAX_RATE_HZ:g}")


def checked_film_hz(film_hz: float) -> float:
    """Return a film's pictures a second; raises InvalidInputError if they are out of range."""
    if 0 <= film_hz <= MAX_FILM_HZ:
        return film_hz
    raise InvalidInputError("film_hz", f"is {film_hz:g}", f"0 (no film) to {MAX_FILM_HZ:g}")


def trajectory_from_journal(path: Path) -> Trajectory:
    """Return a journal's trajectory, without a row that a crash cut off; raises InvalidInputError if it is invalid."""
    rows, head = _rows(path)
    joints = head["joints"]
    if not len(rows):
        raise InvalidInputError("recording", f"{path} has no frames", "at least one")
    times_s, widths_m, states = rows[:, 0], rows[:, 8], rows[:, 9]
    later = np.concatenate([[True], np.diff(times_s) > 0])
    rows, times_s, widths_m, states = rows[later], times_s[later], widths_m[later], states[later]
    arrays = {
        "timestamps": times_s,
        "end_effector_positions": rows[:, 1:4],
        "end_effector_quaternions_xyzw": rows[:, 4:8],
        **_gripper(widths_m, states),
    }
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
    if np.isfinite(widths_m).all():
        still = float(np.ptp(widths_m)) < MIN_GRIPPER_TRAVEL_M
        opened = {"gripper_open": (widths_m > OPEN_ABOVE_M).astype(np.float64)} if still else {}
        return {"gripper_width": widths_m, **opened}
    return {"gripper_open": np.where(np.isfinite(states), states, 1.0)}


def _row(time_s: float, state: ArmState, joints: int) -> Array:
    unknown = np.full(joints, np.nan)
    width_m = np.nan if state.gripper_width_m is None else state.gripper_width_m
    is_open = np.nan if state.gripper_open is None else float(state.gripper_open)
    positions = unknown if state.joint_positions_rad is None else state.joint_positions_rad
    velocities = unknown if state.joint_velocities_rad_s is None else state.joint_velocities_rad_s
    wrench = np.full(WRENCH, np.nan) if state.wrench_n_nm is None else state.wrench_n_nm
    return np.concatenate(
        [[time_s], state.position_m, state.quaternion_xyzw, [width_m, is_open], positions, velocities, wrench]
    ).astype("<f8")


def films_from_journal(path: Path) -> tuple[Film, ...]:
    """Return the films beside a journal, by its clock; raises InvalidInputError if it is invalid."""
    rows, head = _rows(path)
    if not len(rows) or "began_s" not in head:
        return ()
    films = (film_from_file(file, float(head["began_s"]), rows[-1, 0]) for file in film_files(path))
    return tuple(film for film in films if film is not None)


def _rows(path: Path) -> tuple[Array, dict[str, Any]]:
    head, _, body = path.read_bytes().partition(b"\n")
    try:
        known = dict(json.loads(head))
        joints, wrench = int(known["joints"]), int(known.get("wrench", 0))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InvalidInputError("recording", f"{path} is not a journal", "a file of roboprompt-robot record") from error
    width = _FIXED_COLUMNS + 2 * joints + wrench
    whole = len(body) // (8 * width) * width
    return np.frombuffer(body, "<f8", count=whole).reshape(-1, width), known
