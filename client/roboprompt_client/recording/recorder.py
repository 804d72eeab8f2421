"""Record an arm's state while a person moves it, and film it; each sample is on disk within a second."""

import logging
import math
import threading
import time
from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import NamedTuple, Protocol

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.cameras.rig import MountedCamera
from roboprompt_client.encoding import film_jpeg
from roboprompt_client.errors import CameraError, InvalidInputError, MotionError
from roboprompt_client.extras import import_extra
from roboprompt_client.recording import journal as files
from roboprompt_client.types.film import FILM_HZ, MAX_FILM_BYTES, MAX_PICTURE_BYTES, MAX_PICTURES, Film
from roboprompt_client.types.trajectory import Trajectory

RATE_HZ = 50.0
MIN_RATE_HZ, MAX_RATE_HZ = 20.0, 1000.0
MAX_FILM_HZ = 60.0
FLUSH_S = 1.0
log = logging.getLogger(__name__)


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
        self._cameras, self._film_hz, self._films = tuple(cameras) if film_hz else (), film_hz, list[_Filming]()
        self._ended = threading.Event()
        self._progress: Progress | None = None
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    def start(self) -> None:
        """Begin to sample and to film."""
        self._thread.start()
        self._films = [_Filming(camera, self._journal, self._film_hz) for camera in self._cameras]

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
        return files.trajectory_from_journal(self._journal)

    @property
    def films(self) -> tuple[Film, ...]:
        """The cameras' films, after `stop`; a camera without pictures has none."""
        return files.films_from_journal(self._journal)

    def _run(self) -> None:
        try:
            self._sample()
        except MotionError as error:
            self._error = error
        except OSError as error:
            self._error = InvalidInputError("journal", f"cannot be written: {error}", files.WRITABLE)

    def _sample(self) -> None:
        began_s, state = self._read()
        first_s = began_s if state.time_s is None else state.time_s  # by the arm's own clock, where it has one
        joints = 0 if state.joint_positions_rad is None else len(state.joint_positions_rad)
        with files.create_private(self._journal) as file:
            file.write(files.journal_head(state, began_s))
            flushed_s = due_s = seen_s = began_s
            for frames in count(1):  # at least one sample
                self._progress = Progress(frames, seen_s - began_s, state)
                taken_s = seen_s if state.time_s is None else state.time_s
                file.write(files.journal_row(taken_s - first_s, state, joints))
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


class _Filming:
    """Takes a camera's pictures until `stop`. A failure ends the film with a warning, and raises nothing."""

    def __init__(self, camera: MountedCamera, journal: Path, rate_hz: float) -> None:
        self._camera, self._period_s = camera, 1 / rate_hz
        self._path = files.film_file(journal, camera.name)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"film {camera.name}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Take no further picture; return when the camera is free again."""
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            self._film()
        except Exception as error:  # whatever a camera's driver raises: the recording is worth more than its film
            log.warning("the film of camera %s ends here: %s", self._camera.name, error or type(error).__name__)

    def _film(self) -> None:
        cv2 = import_extra("cv2", "opencv-python-headless", "images")
        number, total, shape, last_s, due_s = 0, 0, None, -math.inf, time.monotonic()
        with files.create_private(self._path) as file:
            while not self._ended.wait(due_s - time.monotonic()):
                due_s = max(due_s + self._period_s, time.monotonic())
                picture = self._camera.driver.read()
                taken_s = picture.taken_s - time.time() + time.monotonic()
                if taken_s <= last_s:
                    continue  # the picture before again
                jpeg = film_jpeg(cv2, picture.rgb)
                number, total, shape = number + 1, total + len(jpeg), shape or picture.rgb.shape
                if picture.rgb.shape != shape:
                    raise CameraError("its pictures changed their size", "one size")
                if number > MAX_PICTURES or total > MAX_FILM_BYTES or len(jpeg) > MAX_PICTURE_BYTES:
                    most = f"{MAX_PICTURES} pictures of {MAX_PICTURE_BYTES} bytes, {MAX_FILM_BYTES} together"
                    raise CameraError("a film is full", most)
                file.write(files.film_entry(taken_s, jpeg))
                file.flush()
                last_s = taken_s


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
