"""Nothing half-written: what is exported appears under its name when it is complete."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

from app.datasets.bounds import DatasetError


@contextmanager
def in_one_step(target: Path) -> Iterator[Path]:
    """A path beside `target` to write a file or folder to; it becomes `target` if all goes well, else it is removed.

    Raises:
        DatasetError: if `target` exists, or the disk refuses.
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
