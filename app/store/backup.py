"""Backup of a store into one file, and restoring it.

The file is a tar archive: `roboprompt.db`, a SQLite database with every row of one moment, whatever database they came
from; then `blobs/DIGEST` for each blob that a row refers to. The service goes on meanwhile. A file to be restored may
be damaged, or made to do harm.
"""

import hashlib
import shutil
import tarfile
import tempfile
from collections.abc import Iterator, Set
from contextlib import closing, contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from sqlalchemy import Connection, Table, exc, exists, func, insert, select, text

from app.store import sqlite, tables
from app.store.data_folder import durably_written
from app.store.database import Database, migrate
from app.store.errors import ConflictError, CorruptDataError, disk_errors
from app.store.store import Store, blob_digests

DATABASE_NAME = "roboprompt.db"
BLOB_PREFIX = "blobs/"
ROWS_AT_ONCE = 500
MAX_BLOB_BYTES = 1_000_000_000  # a request brings less by far


@dataclass(frozen=True)
class BackupSummary:
    """The contents of a backup: rows by table, and blobs."""

    rows: dict[str, int]
    num_blobs: int


def back_up(store: Store, path: Path) -> BackupSummary:
    """Write everything of one moment to `path`, which appears when it is complete and on disk.

    Raises:
        StoreUnavailableError, CorruptDataError: if it cannot be written, or a stored blob is damaged or gone.
    """
    temporary = path.with_name(f".{path.name}.tmp")
    with disk_errors("backup"), tempfile.TemporaryDirectory(prefix="roboprompt-backup-", dir=path.parent) as folder:
        rows, digests = _snapshot(store, Path(folder) / DATABASE_NAME)
        with durably_written(path, temporary) as file, tarfile.open(fileobj=file, mode="w:") as archive:
            archive.add(Path(folder) / DATABASE_NAME, DATABASE_NAME)
            for digest in sorted(digests):
                data = store.blobs.read(digest)
                member = tarfile.TarInfo(f"{BLOB_PREFIX}{digest}")
                member.size = len(data)
                archive.addfile(member, BytesIO(data))
    return BackupSummary(rows, len(digests))


def _snapshot(store: Store, path: Path) -> tuple[dict[str, int], set[str]]:
    """Every row, in a new SQLite database, and the digests of the blobs that they refer to."""
    with closing(Database(f"sqlite:///{path}")) as snapshot:
        migrate(snapshot)
        with store.read() as source, snapshot.write() as target, _readable_rows():
            # A backup must not let its holder use another person's session.
            rows, digests = _copy_rows(source, target, {tables.sessions}), blob_digests(source)
        with snapshot.engine.connect() as connection:  # one file, without a log beside it
            connection.exec_driver_sql("ROLLBACK")
            connection.exec_driver_sql("PRAGMA journal_mode=DELETE")
        return rows, digests


@contextmanager
def _readable_rows() -> Iterator[None]:
    """Raise CorruptDataError for a stored row that does not hold what its columns say."""
    try:
        yield
    except (ValueError, TypeError, LookupError) as error:
        raise CorruptDataError("row", "of the database", str(error)) from error


def _copy_rows(source: Connection, target: Connection, left_out: Set[Table]) -> dict[str, int]:
    """Every row but those of some tables, from one database into another; returns their numbers by table."""
    every = tables.metadata.sorted_tables
    return {table.name: 0 if table in left_out else _copy_table(source, target, table) for table in every}


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


def restore(store: Store, path: Path, *, with_keys: bool = False) -> BackupSummary:
    """Put everything of a backup but its API keys into an empty store: all of it or, after an error, no row of it.

    Args:
        with_keys: restore the keys, too, including those revoked since the backup and any that were put into the file.

    Raises:
        ConflictError: if the store has something already; keys do not count, unless they are brought.
        CorruptDataError: if the file is damaged or no backup.
        SchemaVersionError: if newer code wrote it.
        StoreUnavailableError: if it cannot be read, or the store not be written.
    """
    # What a store may have of its own, and a backup does not bring.
    own = {tables.sessions} | (set() if with_keys else {tables.api_keys})
    with store.read() as connection:
        _require_empty(connection, own)
    with tempfile.TemporaryDirectory(prefix="roboprompt-restore-") as folder, _archive(path) as archive:
        database = Path(folder) / DATABASE_NAME
        put = _unpack(store, archive, database, path)
        sqlite.require_plain(database)
        with closing(Database(f"sqlite:///{database}")) as snapshot:
            migrate(snapshot)
            with snapshot.read() as source, store.write() as target:
                _require_empty(target, own)
                if missing := blob_digests(source) - put:
                    raise _damaged(path, f"it lacks {len(missing)} blobs")
                with _row_errors(path):
                    rows = _copy_rows(source, target, own)
    return BackupSummary(rows, len(put))


def _require_empty(connection: Connection, own: Set[Table]) -> None:
    for table in (item for item in tables.metadata.sorted_tables if item not in own):
        if connection.scalar(select(exists(select(1).select_from(table)))):
            raise ConflictError(f"the store has something already ({table.name}): restore into an empty one")


def _unpack(store: Store, archive: tarfile.TarFile, database: Path, path: Path) -> set[str]:
    """Write the database to `database` and put the blobs; returns their digests."""
    put = set()
    for member in _members(archive, path):
        file = archive.extractfile(member)
        if file is None or not (member.name == DATABASE_NAME or member.name.startswith(BLOB_PREFIX)):
            raise _damaged(path, f"{member.name!r:.200} does not belong there")
        if member.name == DATABASE_NAME:
            with database.open("wb") as copy:
                shutil.copyfileobj(file, copy)
            continue
        if member.size > MAX_BLOB_BYTES:
            raise _damaged(path, f"{member.name!r:.200} is larger than any image")
        data = file.read()
        if hashlib.sha256(data).hexdigest() != member.name.removeprefix(BLOB_PREFIX):
            raise _damaged(path, f"the bytes of {member.name} do not match its name")
        put.add(store.blobs.put(data))
    if not database.exists():
        raise _damaged(path, f"it has no {DATABASE_NAME}")
    return put


def _members(archive: tarfile.TarFile, path: Path) -> Iterator[tarfile.TarInfo]:
    """Yield the archive's members; refuse links, devices and sparse files, which no backup has."""
    try:
        for member in archive:
            if not member.isreg() or member.issparse() or member.size < 0:
                raise _damaged(path, f"{member.name!r:.200} is no plain file: it does not belong there")
            yield member
    except (KeyError, ValueError, OverflowError, RecursionError, EOFError, TypeError) as error:
        raise _damaged(path, f"its headers make no sense: {error!r:.200}") from error


def _damaged(path: Path, reason: str) -> CorruptDataError:
    return CorruptDataError("backup", str(path), reason)


@contextmanager
def _archive(path: Path) -> Iterator[tarfile.TarFile]:
    try:
        with disk_errors("backup"), tarfile.open(path, "r:") as archive:
            yield archive
    except tarfile.TarError as error:
        raise _damaged(path, str(error)) from error


@contextmanager
def _row_errors(path: Path) -> Iterator[None]:
    """Rows that no service has written: they contradict each other, or hold no JSON, or other than records have."""
    try:
        yield
    except exc.OperationalError:  # the disk is full, or the server gone
        raise
    except (exc.SQLAlchemyError, ValueError, TypeError, LookupError) as error:
        raise _damaged(path, f"its rows are not as they should be: {str(error).splitlines()[0]:.200}") from error
