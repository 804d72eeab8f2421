"""What language models are working at in every process of a data directory: small files, for people who watch.

Nothing depends on them, so they are not synced; what a killed process leaves behind ends at its deadline.
"""

import json
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from app.store.errors import StoreUnavailableError
from app.store.private import FOLDER_MODE, private_opener


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
        """Let others see it.

        Raises:
            StoreUnavailableError: if it cannot be written.
        """
        path = self._path(note.id)
        unfinished = path.with_suffix(".tmp")
        try:
            self._folder.mkdir(FOLDER_MODE, exist_ok=True)
            with open(unfinished, "w", opener=private_opener) as file:
                json.dump(asdict(note), file)
            unfinished.rename(path)
        except OSError as error:
            raise StoreUnavailableError(f"note of a prediction under way: {error}") from error

    def end(self, note_id: str) -> None:
        """Forget it, if it is there."""
        self._path(note_id).unlink(missing_ok=True)

    def all(self) -> tuple[UnderWay, ...]:
        """Everything under way, the oldest first; what is past its deadline is forgotten."""
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
