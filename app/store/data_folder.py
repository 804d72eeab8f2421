"""The files of a data folder: readable by the service's user alone, as they hold pictures, prompts, keys' digests."""

import logging
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from app.store.errors import StoreUnavailableError

FOLDER_MODE, FILE_MODE = 0o700, 0o600
OTHERS = 0o077
# What a data folder has; one with other folders and none of these is a home folder, or the system's.
MARKS = ("roboprompt.db", "blobs", "llm", "cache", ".swept")

logger = logging.getLogger(__name__)


def private_opener(path: str, flags: int) -> int:
    """For `open(..., opener=private_opener)`: a file that it makes is the user's alone."""
    return os.open(path, flags, FILE_MODE)


@contextmanager
def durably_written(path: Path, temporary: Path) -> Iterator[BinaryIO]:
    """A private file that takes the place of `path` at the end of the block, whole and synced; else it goes."""
    try:
        with open(temporary, "wb", opener=private_opener) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def private_file(path: Path) -> None:
    """Make the file if it is not there, and take it from others if it is; raises OSError.

    A file that is there is never opened: to close it would drop every lock that this process holds on it, SQLite's
    among them (https://sqlite.org/howtocorrupt.html, 2.2), and another process would then delete the log in use.
    """
    try:
        os.close(private_opener(str(path), os.O_RDWR | os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        status = path.stat()
        if status.st_mode & OTHERS and status.st_uid == os.geteuid():
            path.chmod(FILE_MODE)


def private_folder(path: Path) -> None:
    """Make the folder if it is not there; take one that others can read, with all that is in it, from them.

    Raises:
        StoreUnavailableError: if it cannot be made, is another user's, or is visibly no data folder.
    """
    try:
        path.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        mode = stat.S_IMODE(path.stat().st_mode)
        if mode & OTHERS:
            require_ours(path, mode)
            _tighten(path)
            logger.warning("data directory %s was open to others (mode %03o); it is now private", path, mode)
    except OSError as error:
        raise StoreUnavailableError(f"data directory: {error}") from error


def require_ours(path: Path, mode: int) -> None:
    """Refuse a folder whose mode is not ours to change; raises StoreUnavailableError."""
    opened = f"data directory {path} is open to others (mode {mode:03o})"
    owner = path.stat().st_uid
    if owner != os.geteuid() and os.geteuid() != 0:
        raise StoreUnavailableError(
            f"{opened} and belongs to user {owner}: name a folder of this user's, or give it to them"
        )
    inside = [entry for entry in os.scandir(path) if entry.is_dir(follow_symlinks=False)]
    shared = bool(mode & stat.S_ISVTX)
    if shared or (inside and not any((path / name).exists() for name in MARKS)):
        raise StoreUnavailableError(f"{opened} and holds files of others: name a folder of its own")


def _tighten(folder: Path) -> None:
    """The folder first: from then on other users cannot reach what is in it."""
    folder.chmod(FOLDER_MODE)
    for current, folders, files in os.walk(folder):
        for names, mode in ((folders, FOLDER_MODE), (files, FILE_MODE)):
            for path in (Path(current) / name for name in names):
                if not path.is_symlink():
                    path.chmod(mode)
