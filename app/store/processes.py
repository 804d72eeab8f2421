"""Files that the processes of a data directory share: turns, and notes of unfinished predictions.

One process holds a turn at a time: a locked file, which the system unlocks if its holder dies. Notes are for people who
watch: nothing depends on them and they are not synced. One that a killed process leaves behind ends at its deadline.
"""

import fcntl
import hashlib
import json
import os
import time
import weakref
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from app.store.errors import disk_errors
from app.store.private import FOLDER_MODE, private_opener


class Turn:
    """A turn that is held; `with` ends it, and so does dropping the object."""

    def __init__(self, path: Path, descriptor: int) -> None:
        self._path = path
        self._close = weakref.finalize(self, os.close, descriptor)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._path.unlink(missing_ok=True)  # before it is unlocked: who has it open finds that it is not there
        self._close()


class Turns:
    """The turns of one data directory. Synchronous."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def take(self, name: str) -> Turn | None:
        """The turn of that name, or None while it is held elsewhere; raises StoreUnavailableError."""
        path = self._folder / hashlib.sha256(name.encode(errors="surrogatepass")).hexdigest()
        with disk_errors("turns of requests"):
            self._folder.mkdir(FOLDER_MODE, exist_ok=True)
            descriptor = private_opener(str(path), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
            with suppress(BlockingIOError, FileNotFoundError):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(descriptor).st_ino == path.stat().st_ino:
                    return Turn(path, descriptor)
            os.close(descriptor)
        return None


@dataclass(frozen=True)
class UnderWay:
    """A prediction that is not finished.

    Attributes:
        started_s, deadline_s: seconds since the epoch.
    """

    id: str
    task: str
    instruction: str
    model: str
    started_s: float
    deadline_s: float


class UnderWayNotes:
    """The notes of one data directory. Synchronous: call it in a thread."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def begin(self, note: UnderWay) -> None:
        """Let others see it; raises StoreUnavailableError."""
        path = self._path(note.id)
        unfinished = path.with_suffix(".tmp")
        with disk_errors("note of a prediction under way"):
            self._folder.mkdir(FOLDER_MODE, exist_ok=True)
            with open(unfinished, "w", opener=private_opener) as file:
                json.dump(asdict(note), file)
            unfinished.rename(path)

    def end(self, note_id: str) -> None:
        """Forget it, if it is there."""
        self._path(note_id).unlink(missing_ok=True)

    def all(self) -> tuple[UnderWay, ...]:
        """Return the unfinished predictions, oldest first; delete notes past their deadline."""
        return tuple(sorted(self._living(time.time()), key=lambda note: note.started_s))

    def _living(self, now_s: float) -> Iterator[UnderWay]:
        for path in self._folder.glob("*.json"):
            try:
                note = UnderWay(**json.loads(path.read_text()))
            except FileNotFoundError:
                continue  # it ended just now
            if note.deadline_s < now_s:
                self.end(note.id)
            else:
                yield note

    def _path(self, note_id: str) -> Path:
        return self._folder / f"{note_id}.json"
