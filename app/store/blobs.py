"""Images and other bulk as immutable files, named by the SHA-256 of their bytes.

An upload puts its blobs first and commits its row last: a crash in between leaves files that no row names, never a row
without its files. `sweep` removes such leftovers.
"""

import fcntl
import hashlib
import os
import re
import time
from collections.abc import Iterable, Iterator, Set
from contextlib import contextmanager
from datetime import timedelta
from itertools import chain
from pathlib import Path
from typing import Protocol
from uuid import uuid4

from app.store.data_folder import FILE_MODE, FOLDER_MODE, durably_written
from app.store.errors import CorruptDataError, StoreUnavailableError, disk_errors

_DIGEST = re.compile(r"[0-9a-f]{64}")
_QUOTED_DIGEST = re.compile(r'"([0-9a-f]{64})"')


class BlobStore(Protocol):
    """Immutable bytes under their SHA-256. Safe for concurrent use by threads and processes.

    Raises:
        StoreUnavailableError: in every method, if the disk is full, read-only or gone.
    """

    def put(self, data: bytes) -> str:
        """Store `data` so that it survives a power cut; returns its digest. What is there already is not rewritten."""
        ...

    def read(self, digest: str) -> bytes:
        """The bytes of that digest; raises CorruptDataError if they are gone or no longer match it."""
        ...

    def sweep(self, referenced: Set[str], older_than: timedelta) -> int:
        """Remove blobs that are not `referenced`, and unfinished writes; returns how many.

        Args:
            older_than: what was put more recently stays: its row may not be committed yet. Longer than any upload.
        """
        ...


class FileBlobStore:
    """A BlobStore in a folder of the local disk, which is created if it is not there: `root/ab/cd/abcd...`."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._synced_folders: set[Path] = set()
        try:
            root.mkdir(FOLDER_MODE, parents=True, exist_ok=True)
            (root / ".lock").touch(FILE_MODE)
        except OSError as error:
            raise StoreUnavailableError(f"blob storage: {error}") from error

    def put(self, data: bytes) -> str:
        digest = hashlib.sha256(data).hexdigest()
        path = self._path(digest)
        with disk_errors("blob storage"):
            if not self._renew(path):
                for folder in (path.parent.parent, path.parent):
                    folder.mkdir(FOLDER_MODE, exist_ok=True)
                with durably_written(path, path.with_name(f".tmp-{uuid4().hex}")) as file:
                    file.write(data)
            # Also for a blob that was there: the request that wrote it may not have synced it yet.
            self._sync_entry(path)
        return digest

    def read(self, digest: str) -> bytes:
        with disk_errors("blob storage"):
            try:
                data = self._path(digest).read_bytes()
            except FileNotFoundError as error:
                raise CorruptDataError("blob", digest, "its file is gone") from error
        if hashlib.sha256(data).hexdigest() != digest:
            raise CorruptDataError("blob", digest, "its bytes do not match the digest")
        return data

    def sweep(self, referenced: Set[str], older_than: timedelta) -> int:
        limit = time.time() - older_than.total_seconds()
        with disk_errors("blob storage"):
            leftovers = [path for path in self._root.glob("??/??/*") if path.name not in referenced]
            return sum(self._remove_if_older(path, limit) for path in leftovers)

    def _path(self, digest: str) -> Path:
        return self._root / digest_path(digest)

    def _sync_entry(self, path: Path) -> None:
        """Make `path`'s name in its folder survive a power cut, and that folder's own up to the root."""
        _sync_folder(path.parent)
        if path.parent != self._root and path.parent not in self._synced_folders:
            self._sync_entry(path.parent)
            self._synced_folders.add(path.parent)

    def _renew(self, path: Path) -> bool:
        """Whether `path` exists; if so it counts as put just now, so that no sweep takes it before the commit."""
        with self._lock(fcntl.LOCK_SH):
            try:
                os.utime(path)
            except FileNotFoundError:
                return False
            return True

    def _remove_if_older(self, path: Path, limit: float) -> bool:
        with self._lock(fcntl.LOCK_EX):
            try:
                if path.stat().st_mtime >= limit:
                    return False
                path.unlink()
            except FileNotFoundError:  # renamed to its digest, or swept by another process
                return False
            return True

    @contextmanager
    def _lock(self, kind: int) -> Iterator[None]:
        """Between processes too; released when the file is closed."""
        with (self._root / ".lock").open("rb") as file:
            fcntl.flock(file, kind)
            yield


def digests_in(texts: Iterable[str]) -> Iterator[str]:
    """The digests that JSON names, found without decoding it."""
    return chain.from_iterable(map(_QUOTED_DIGEST.findall, texts))


def digest_path(digest: str) -> str:
    """Return a blob's path below the root, in one of 65,536 folders; raises CorruptDataError."""
    if not _DIGEST.fullmatch(digest):
        raise CorruptDataError("blob", digest, "not a SHA-256 in hexadecimal")
    return f"{digest[:2]}/{digest[2:4]}/{digest}"


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
