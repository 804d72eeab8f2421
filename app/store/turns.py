"""One at a time, among all processes of a data directory: locked files, which the system frees if their holder dies."""

import fcntl
import hashlib
import os
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from app.store.errors import StoreUnavailableError
from app.store.private import FOLDER_MODE, private_opener


class Turn:
    """The turn that somebody has; leave it by `with`. One that is only dropped is left, too."""

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self._path = path
        self._file = file

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._path.unlink(missing_ok=True)  # before it is unlocked: who has it open finds that it is not there
        self._file.close()


class Turns:
    """The turns of one data directory. Synchronous."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def take(self, name: str) -> Turn | None:
        """The turn of that name, or None while somebody else has it.

        Raises:
            StoreUnavailableError: if the folder cannot be written.
        """
        path = self._folder / hashlib.sha256(name.encode(errors="surrogatepass")).hexdigest()
        try:
            self._folder.mkdir(FOLDER_MODE, exist_ok=True)
            file = open(path, "ab", opener=private_opener)  # noqa: SIM115 - it stays open while the turn lasts
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(file.fileno()).st_ino == path.stat().st_ino:
                    return Turn(path, file)
            except (BlockingIOError, FileNotFoundError):
                pass
            file.close()
        except OSError as error:
            raise StoreUnavailableError(f"turns of requests: {error}") from error
        return None
