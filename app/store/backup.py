"""All that is stored in one file, and back: into the same kind of database or the other.

The file is a tar archive: `roboprompt.db`, a SQLite database with every row of one moment, whatever database they came
from; then `blobs/DIGEST` for each blob that a row refers to. The service goes on meanwhile.
"""

import hashlib
import os
import shutil
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from sqlalchemy import Connection, Table, exists, func, insert, select, text

from app.store import episodes
from app.store.database import Database
from app.store.errors import ConflictError, CorruptDataError, StoreUnavailableError
from app.store.migration import migrate
from app.store.store import Store
from app.store.tables import metadata

DATABASE_NAME = "roboprompt.db"
BLOB_PREFIX = "blobs/"
ROWS_AT_ONCE = 500


@dataclass(frozen=True)
class BackupSummary:
    """What a backup holds: rows by table, and blobs."""

    rows: dict[str, int]
    num_blobs: int


def back_up(store: Store, path: Path) -> BackupSummary:
    """Write everything of one moment to `path`, which appears when it is complete and on disk.

    Raises:
        StoreUnavailableError: if it cannot be written.
        CorruptDataError: if a stored blob is damaged or gone.
    """
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        with _disk_errors(), tempfile.TemporaryDirectory(prefix="roboprompt-backup-", dir=path.parent) as folder:
            rows, digests = _snapshot(store, Path(folder) / DATABASE_NAME)
            with temporary.open("wb") as file:
                with tarfile.open(fileobj=file, mode="w:") as archive:
                    archive.add(Path(folder) / DATABASE_NAME, DATABASE_NAME)
                    for digest in sorted(digests):
                        _add(archive, f"{BLOB_PREFIX}{digest}", store.blobs.read(digest))
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return BackupSummary(rows, len(digests))


def restore(store: Store, path: Path) -> BackupSummary:
    """Put everything of a backup into an empty store: all of it or, after an error, no row of it.

    Raises:
        ConflictError: if the store has something already.
        CorruptDataError: if the file is damaged or no backup.
        SchemaVersionError: if newer code wrote it.
        StoreUnavailableError: if it cannot be read, or the store not be written.
    """
    with store.read() as connection:
        _require_empty(connection)
    with tempfile.TemporaryDirectory(prefix="roboprompt-restore-") as folder, _archive(path) as archive:
        put = _unpack(store, archive, Path(folder) / DATABASE_NAME, path)
        snapshot = Database(f"sqlite:///{Path(folder) / DATABASE_NAME}")
        try:
            migrate(snapshot)
            with snapshot.read() as source, store.write() as target:
                _require_empty(target)
                if missing := episodes.blob_digests(source) - put:
                    raise CorruptDataError("backup", str(path), f"it lacks {len(missing)} blobs")
                rows = _copy(source, target)
        finally:
            snapshot.close()
    return BackupSummary(rows, len(put))


def _snapshot(store: Store, path: Path) -> tuple[dict[str, int], set[str]]:
    """Every row, in a new SQLite database, and the digests of the blobs that they refer to."""
    snapshot = Database(f"sqlite:///{path}")
    try:
        migrate(snapshot)
        with store.read() as source, snapshot.write() as target:
            rows, digests = _copy(source, target), episodes.blob_digests(source)
        with snapshot.engine.connect() as connection:  # one file, without a log beside it
            connection.exec_driver_sql("ROLLBACK")
            connection.exec_driver_sql("PRAGMA journal_mode=DELETE")
        return rows, digests
    finally:
        snapshot.close()


def _copy(source: Connection, target: Connection) -> dict[str, int]:
    return {table.name: _copy_table(source, target, table) for table in metadata.sorted_tables}


def _copy_table(source: Connection, target: Connection, table: Table) -> int:
    found = source.execution_options(yield_per=ROWS_AT_ONCE).execute(select(table)).mappings()
    number = 0
    for rows in found.partitions():
        target.execute(insert(table), [dict(row) for row in rows])
        number += len(rows)
    if number and "sequence" in table.c and target.dialect.name == "postgresql":
        newest = target.scalar(select(func.max(table.c.sequence)))
        counter = text("SELECT setval(pg_get_serial_sequence(:table, 'sequence'), :newest)")
        target.execute(counter, {"table": table.name, "newest": newest})
    return number


def _require_empty(connection: Connection) -> None:
    for table in metadata.sorted_tables:
        if connection.scalar(select(exists(select(1).select_from(table)))):
            raise ConflictError(f"the store has something already ({table.name}): restore into an empty one")


def _unpack(store: Store, archive: tarfile.TarFile, database: Path, path: Path) -> set[str]:
    """Write the database to `database` and put the blobs; returns their digests."""
    put = set()
    for member in archive:
        file = archive.extractfile(member)
        if file is None or not (member.name == DATABASE_NAME or member.name.startswith(BLOB_PREFIX)):
            raise CorruptDataError("backup", str(path), f"{member.name!r} does not belong there")
        if member.name == DATABASE_NAME:
            with database.open("wb") as copy:
                shutil.copyfileobj(file, copy)
            continue
        data = file.read()
        digest = member.name.removeprefix(BLOB_PREFIX)
        if hashlib.sha256(data).hexdigest() != digest:
            raise CorruptDataError("backup", str(path), f"the bytes of {member.name} do not match its name")
        put.add(store.blobs.put(data))
    if not database.exists():
        raise CorruptDataError("backup", str(path), f"it has no {DATABASE_NAME}")
    return put


def _add(archive: tarfile.TarFile, name: str, data: bytes) -> None:
    member = tarfile.TarInfo(name)
    member.size = len(data)
    archive.addfile(member, BytesIO(data))


@contextmanager
def _archive(path: Path) -> Iterator[tarfile.TarFile]:
    try:
        with _disk_errors(), tarfile.open(path, "r:") as archive:
            yield archive
    except tarfile.TarError as error:
        raise CorruptDataError("backup", str(path), str(error)) from error


@contextmanager
def _disk_errors() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StoreUnavailableError(f"backup: {error}") from error
