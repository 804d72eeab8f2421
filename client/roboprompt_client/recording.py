"""Record an arm's state while a person moves it. A recording is a folder that is written when it has ended.

The folder has the parts of an upload as files, and its name is the upload's idempotency key: it can be sent again, and
is stored once. A recording that is broken off has no folder.
"""

import shutil
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.encoding import CONTENT_TYPES, Part, episode_parts
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.robot import Observation
from roboprompt_client.types.gripper import MIN_TRAVEL_M
from roboprompt_client.types.trajectory import Trajectory, trajectory_from_arrays

RATE_HZ = 50.0
MIN_RATE_HZ, MAX_RATE_HZ = 20.0, 1000.0
Sample = tuple[float, ArmState]  # with its time in seconds
OPEN_ABOVE_M = 0.01  # fingers that never move count as open above this width


class Recorder:
    """Samples the `state` of an `Arm`, or of another robot that has one (`ArmState`, world frame), in a thread.

        recorder = Recorder(arm)
        recorder.start()
        input("Guide the arm, then press Enter: ")
        client.upload("pick", "pick up the cube", recorder.stop(), observation)

    Args:
        rate_hz: at least 20.

    Raises:
        InvalidInputError: for a rate out of range.
    """

    def __init__(self, arm: Any, rate_hz: float = RATE_HZ) -> None:  # noqa: ANN401
        self._arm, self._period_s = arm, 1 / checked_rate_hz(rate_hz)
        self._samples: list[Sample] = []
        self._ended = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    def start(self) -> None:
        """Begin to sample."""
        self._thread.start()

    @property
    def samples(self) -> Sequence[Sample]:
        """What was recorded so far; raises MotionError if the arm stopped answering."""
        if self._error is not None:
            raise self._error
        return self._samples

    def stop(self) -> Trajectory:
        """Stop sampling, and return the trajectory.

        Raises:
            MotionError: if the arm stopped answering.
            InvalidInputError: if the samples are not a valid trajectory.
        """
        self._ended.set()
        self._thread.join()
        return _trajectory(self.samples)

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._samples or not self._ended.wait(due_s - time.monotonic()):  # at least one sample
            asked_s = time.monotonic()
            try:
                state = self._arm.state()
            except MotionError as error:
                self._error = error
                return
            seen_s = (asked_s + time.monotonic()) / 2
            # by the arm's own clock, where it has one
            self._samples.append((seen_s if state.time_s is None else state.time_s, state))
            due_s = max(due_s + self._period_s, seen_s)


def checked_rate_hz(rate_hz: float) -> float:
    """Return a sampling rate; raises InvalidInputError if it is out of range."""
    if MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ:
        return rate_hz
    raise InvalidInputError("rate_hz", f"is {rate_hz:g}", f"{MIN_RATE_HZ:g} to {MAX_RATE_HZ:g}")


def _trajectory(samples: Sequence[Sample]) -> Trajectory:
    times_s = np.array([time_s for time_s, _ in samples])
    kept = np.flatnonzero(np.diff(times_s, prepend=-np.inf) > 0)
    states = [samples[k][1] for k in kept.tolist()]
    arrays: dict[str, Any] = {
        "timestamps": times_s[kept] - times_s[0],
        "end_effector_positions": np.array([state.position_m for state in states]),
        "end_effector_quaternions_xyzw": np.array([state.quaternion_xyzw for state in states]),
        **_gripper(states),
    }
    fields = {"joint_positions": "joint_positions_rad", "wrenches": "wrench_n_nm"}
    if states[0].joint_positions_rad is not None:
        fields["joint_velocities"] = "joint_velocities_rad_s"
    for name, field in fields.items():
        values = [getattr(state, field) for state in states]
        if all(value is not None and np.isfinite(value).all() for value in values):
            arrays[name] = np.array(values)
    return trajectory_from_arrays(arrays)


def _gripper(states: Sequence[ArmState]) -> dict[str, Any]:
    """Return the measured width, else the known state; an arm without a gripper counts as open."""
    widths_m = np.array([np.nan if state.gripper_width_m is None else state.gripper_width_m for state in states])
    if not np.isfinite(widths_m).all():
        return {"gripper_open": np.array([state.gripper_open is not False for state in states], float)}
    if float(np.ptp(widths_m)) >= MIN_TRAVEL_M:
        return {"gripper_width": widths_m}
    return {"gripper_width": widths_m, "gripper_open": (widths_m > OPEN_ABOVE_M).astype(np.float64)}


def write_recording(
    parent: Path, metadata: Mapping[str, Any], trajectory: Trajectory, observation: Observation
) -> Path:
    """Write a recording that has ended; return its folder in `parent`, which appears when all of it is written.

    Objects and cameras are added to `metadata`. Raises InvalidInputError if it cannot be written, as on a full disk.
    """
    folder = parent / uuid4().hex
    begun = folder.with_suffix(".part")
    try:
        begun.mkdir(mode=0o700, parents=True)
        for file, data, _ in episode_parts(metadata, trajectory, observation).values():
            (begun / file).write_bytes(data)
        return begun.rename(folder)
    except OSError as error:
        shutil.rmtree(begun, ignore_errors=True)
        raise InvalidInputError("folder", f"{begun} cannot be written: {error}", "a disk with space") from error


def upload_recording(client: RoboPromptClient, folder: Path) -> dict[str, Any]:
    """Upload a recording, and return the service's description of it; sent again, it is stored once.

    Raises InvalidInputError if the folder is not a finished recording.
    """
    files = [file for file in sorted(folder.iterdir()) if file.suffix in CONTENT_TYPES] if folder.is_dir() else []
    parts: dict[str, Part] = {file.stem: (file.name, file.read_bytes(), CONTENT_TYPES[file.suffix]) for file in files}
    if folder.suffix or not {"metadata", "trajectory"} <= set(parts):
        valid = "a folder that `roboprompt-robot record` has written to its end"
        raise InvalidInputError("recording", f"{folder} is not a finished recording", valid)
    return client.upload_parts(parts, folder.resolve().name)
