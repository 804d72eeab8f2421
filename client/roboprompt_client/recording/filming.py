"""Film with one camera beside a recording, in a thread; each picture is on disk as soon as it is taken.

A film's file has for each picture its time (float64, by `time.monotonic`) and its size (uint32), both little-endian,
and then the JPEG file.
"""

import logging
import math
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from roboprompt_client.cameras.rig import MountedCamera
from roboprompt_client.errors import CameraError
from roboprompt_client.extras import import_extra
from roboprompt_client.http.encoding import film_jpeg
from roboprompt_client.recording.private import create_private
from roboprompt_client.types.film import MAX_FILM_BYTES, MAX_PICTURE_BYTES, MAX_PICTURES, Film

MARK = ".film_"
_ENTRY = struct.Struct("<dI")
log = logging.getLogger(__name__)


class Filming:
    """Takes a camera's pictures until `stop`. A failure ends the film with a warning, and raises nothing.

    Args:
        journal: of the recording; the film is a file beside it.
    """

    def __init__(self, camera: MountedCamera, journal: Path, rate_hz: float) -> None:
        self._camera, self._period_s = camera, 1 / rate_hz
        self._path = journal.with_name(f"{journal.name}{MARK}{camera.name}")
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
        with create_private(self._path) as file:
            while not self._ended.wait(due_s - time.monotonic()):
                due_s = max(due_s + self._period_s, time.monotonic())
                picture = self._camera.driver.read()
                taken_s = picture.taken_s - time.time() + time.monotonic()
                if taken_s <= last_s:
                    continue  # the picture before again
                data = film_jpeg(cv2, picture.rgb)
                number, total, shape = number + 1, total + len(data), shape or picture.rgb.shape
                if picture.rgb.shape != shape:
                    raise CameraError("its pictures changed their size", "one size")
                if number > MAX_PICTURES or total > MAX_FILM_BYTES or len(data) > MAX_PICTURE_BYTES:
                    most = f"{MAX_PICTURES} pictures of {MAX_PICTURE_BYTES} bytes, {MAX_FILM_BYTES} together"
                    raise CameraError("a film is full", most)
                file.write(_ENTRY.pack(taken_s, len(data)) + data)
                file.flush()
                last_s = taken_s


def film_files(journal: Path) -> list[Path]:
    """Return the files of the films beside a journal."""
    return sorted(journal.parent.glob(f"{journal.name}{MARK}*"))


def film_from_file(path: Path, began_s: float, end_s: float) -> Film | None:
    """Return the pictures that were taken during a recording, without one that a crash cut off; None if there is none.

    Args:
        began_s: of the recording, by `time.monotonic`; the film's times begin there.
        end_s: of the recording's last frame, from its first.
    """
    taken = [(time_s - began_s, data) for time_s, data in _entries(path.read_bytes())]
    kept = [(time_s, data) for time_s, data in taken if 0 <= time_s <= end_s]
    if not kept:
        return None
    times_s, pictures = zip(*kept, strict=True)
    return Film(path.name.partition(MARK)[2], np.array(times_s), pictures)


def _entries(content: bytes) -> Iterator[tuple[float, bytes]]:
    start = 0
    while start + _ENTRY.size <= len(content):
        time_s, size = _ENTRY.unpack_from(content, start)
        start += _ENTRY.size + size
        if start > len(content):
            return
        yield time_s, content[start - size : start]
