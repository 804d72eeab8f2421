"""All that is stored in one file; `app.store.restore` is the way back.

The file is a tar archive: `roboprompt.db`, a SQLite database with every row of one moment, whatever database they came
from; then `blobs/DIGEST` for each blob that a row refers to. The service goes on meanwhile.
"""

import os
import tarfile
import tempfile
from collections.abc import Iterator, Set
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from sqlalchemy import Connection, Table, func, insert, select, text

from app.store.database import Database
from app.store.errors import StoreUnavailableError
from app.store.migration import migrate
from app.store.private import private_opener
from app.store.references import blob_digests
from app.store.store import Store
from app.store.tables import metadata, sessions

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
        with disk_errors(), tempfile.TemporaryDirectory(prefix="roboprompt-backup-", dir=path.parent) as folder:
            rows, digests = _snapshot(store, Path(folder) / DATABASE_NAME)
            with open(temporary, "wb", opener=private_opener) as file:
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


def _snapshot(store: Store, path: Path) -> tuple[dict[str, int], set[str]]:
    """Every row, in a new SQLite database, and the digests of the blobs that they refer to."""
    snapshot = Database(f"sqlite:///{path}")
    try:
        migrate(snapshot)
        with store.read() as source, snapshot.write() as target:
            # A backup must not let its holder use another person's session.
            rows, digests = copy_rows(source, target, {sessions.name}), blob_digests(source)
        with snapshot.engine.connect() as connection:  # one file, without a log beside it
            connection.exec_driver_sql("ROLLBACK")
            connection.exec_driver_sql("PRAGMA journal_mode=DELETE")
        return rows, digests
    finally:
        snapshot.close()


def copy_rows(source: Connection, target: Connection, left_out: Set[str] = frozenset()) -> dict[str, int]:
    """Every row but those of some tables, from one database into another; returns their numbers by table."""
    return {
        table.name: 0 if table.name in left_out else _copy_table(source, target, table)
        for table in metadata.sorted_tables
    }


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


def _add(archive: tarfile.TarFile, name: str, data: bytes) -> None:
    member = tarfile.TarInfo(name)
    member.size = len(data)
    archive.addfile(member, BytesIO(data))


@contextmanager
def disk_errors() -> Iterator[None]:
    """The disk's failures as StoreUnavailableError."""
    try:
        yield
    except OSError as error:
        raise StoreUnavailableError(f"backup: {error}") from error
