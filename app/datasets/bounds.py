"""Limits on reading untrusted datasets, their errors, and atomic writing.

Paths and links in a dataset may point to any file of this machine, and a small file may unpack to any size.
"""

import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

from roboprompt_client.errors import RoboPromptError

MEGABYTE = 1_000_000
MAX_UNPACKED_BYTES = 500 * MEGABYTE
REMEDY = "--max-unpacked-mb allows more, if you trust where it comes from"


class DatasetError(RoboPromptError):
    """A dataset as a whole cannot be read or written."""

    def __init__(self, message: str) -> None:
        # Names in a dataset could move the cursor of the terminal that shows them.
        super().__init__("".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in message))


class DamagedError(DatasetError):
    """One file of a dataset is damaged or incomplete; others can be read."""

    def __init__(self, file: object, reason: object) -> None:
        super().__init__(f"{file}: {reason}")


class Budget:
    """Counts the unpacked bytes of a file, `where`, and refuses more than `limit_bytes`."""

    def __init__(self, where: object, limit_bytes: int = MAX_UNPACKED_BYTES) -> None:
        self._where, self._limit_bytes = where, limit_bytes
        self._taken_bytes = 0

    @property
    def left_bytes(self) -> int:
        return self._limit_bytes - self._taken_bytes

    def take(self, num_bytes: int, where: object = None) -> None:
        """Count bytes that are unpacked at `where` (default: the budget's own file).

        Raises:
            DamagedError: if they are too many, or negative.
        """
        if num_bytes < 0:
            raise DamagedError(where or self._where, f"says that it holds {num_bytes} bytes")
        if num_bytes > self.left_bytes:
            limit = f"{self._limit_bytes / MEGABYTE:g} MB"
            raise DamagedError(where or self._where, f"unpacks to more than {limit}: {REMEDY}")
        self._taken_bytes += num_bytes


def inside(root: Path, path: Path | str) -> Path:
    """Return the resolved `path`, which is relative to the resolved `root` or absolute, and need not exist.

    Raises:
        DamagedError: if `..`, an absolute path or a link leads out of `root`.
    """
    named = root / path
    try:
        found = named.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # RuntimeError: links in a circle; ValueError: a NUL
        raise DamagedError(repr(str(named)), f"is no path: {error}") from error
    if not any(found.is_relative_to(folder) for folder in _folders(root)):
        raise DamagedError(
            named, f"leads out of the dataset, to {found}: if it belongs to it, put the file itself there"
        )
    return found


def read_inside(root: Path, path: Path | str, budget: Budget) -> bytes:
    """Return the bytes of a regular file below `root`; raises DamagedError for any other file, or one too large."""
    found = inside(root, path)
    try:
        # Without O_NONBLOCK, opening a pipe would wait for a writer.
        with open(os.open(found, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise DamagedError(found, "is not a regular file")
            budget.take(status.st_size, found)
            return file.read(status.st_size)
    except OSError as error:
        raise DamagedError(found, f"cannot be read: {error.strerror or error}") from error


def _folders(root: Path) -> tuple[Path, ...]:
    """Return the allowed folders: the root, and for a snapshot in Hugging Face's cache the target of its links."""
    repository = root.parent.parent
    if root.parent.name == "snapshots" and repository.name.startswith("datasets--"):
        return root, repository / "blobs"
    return (root,)


@contextmanager
def in_one_step(target: Path) -> Iterator[Path]:
    """Yield a temporary path for a file or folder, which is renamed to `target` on success and removed otherwise.

    Raises:
        DatasetError: if `target` exists or cannot be written.
    """
    if target.exists():
        raise DatasetError(f"{target} exists: name another, or remove it first")
    unfinished = target.with_name(f".{target.name}.{uuid4().hex[:8]}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield unfinished
        unfinished.rename(target)
    except OSError as error:
        raise DatasetError(f"{target}: cannot be written: {error}") from error
    finally:
        if unfinished.is_dir():
            shutil.rmtree(unfinished, ignore_errors=True)
        else:
            unfinished.unlink(missing_ok=True)
