"""One at a time, among all processes of a data directory: locked files, which the system frees if their holder dies."""

import fcntl
import hashlib
import os
import weakref
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from app.store.errors import StoreUnavailableError
from app.store.private import FOLDER_MODE, private_opener


class Turn:
    """The turn that somebody has; leave it by `with`. One that is only dropped is left, too."""

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
        """The turn of that name, or None while somebody else has it.

        Raises:
            StoreUnavailableError: if the folder cannot be written.
        """
        path = self._folder / hashlib.sha256(name.encode(errors="surrogatepass")).hexdigest()
        try:
            self._folder.mkdir(FOLDER_MODE, exist_ok=True)
            descriptor = private_opener(str(path), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
            with suppress(BlockingIOError, FileNotFoundError):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(descriptor).st_ino == path.stat().st_ino:
                    return Turn(path, descriptor)
            os.close(descriptor)
        except OSError as error:
            raise StoreUnavailableError(f"turns of requests: {error}") from error
        return None
