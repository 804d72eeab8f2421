"""Files of a dataset's folder, and no others: its paths and links may name any file of this machine."""

import os
import stat
from pathlib import Path

from app.datasets.errors import DamagedError
from app.datasets.limits import Budget


def inside(root: Path, path: Path | str) -> Path:
    """Where `path`, below `root` if it is relative, really is; it need not exist.

    Args:
        root: the dataset's folder, resolved.

    Raises:
        DamagedError: if that is not below `root`, by `..`, an absolute path or a link.
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
    """The bytes of a regular file below `root`.

    Raises:
        DamagedError: naming the file that cannot be read, is too large, a device or a pipe, or elsewhere.
    """
    found = inside(root, path)
    try:
        # Opening a pipe would wait for somebody who writes to it.
        with open(os.open(found, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise DamagedError(found, "is not a regular file")
            budget.take(status.st_size, found)
            return file.read(status.st_size)
    except OSError as error:
        raise DamagedError(found, f"cannot be read: {error.strerror or error}") from error


def _folders(root: Path) -> tuple[Path, ...]:
    """The root; of a snapshot in Hugging Face's cache also the folder that its links lead to."""
    repository = root.parent.parent
    if root.parent.name == "snapshots" and repository.name.startswith("datasets--"):
        return root, repository / "blobs"
    return (root,)
