"""A backup back into a store, of either kind of database. The file may be damaged, or made to do harm."""

import hashlib
import logging
import shutil
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, exc, exists, select

from app.store import api_keys, audit, sqlite, tables
from app.store.backup import BLOB_PREFIX, DATABASE_NAME, BackupSummary, copy_rows, disk_errors
from app.store.database import Database
from app.store.errors import ConflictError, CorruptDataError
from app.store.migration import migrate
from app.store.references import blob_digests
from app.store.store import Store
from app.store.tables import metadata

MAX_BLOB_BYTES = 1_000_000_000  # a request brings less by far

logger = logging.getLogger(__name__)


def restore(store: Store, path: Path, *, with_keys: bool = False) -> BackupSummary:
    """Put everything of a backup but its API keys into an empty store: all of it or, after an error, no row of it.

    The audit log of a store that has none yet goes on where the backup's ends; another stays, and notes the restore.

    Args:
        with_keys: restore the keys, too, including those revoked since the backup and any that were put into the file.

    Raises:
        ConflictError: if the store has something already; keys and an audit log do not count, unless keys are brought.
        CorruptDataError: if the file is damaged or no backup.
        SchemaVersionError: if newer code wrote it.
        StoreUnavailableError: if it cannot be read, or the store not be written.
    """
    with store.read() as connection:
        _require_empty(connection, with_keys=with_keys)
    with tempfile.TemporaryDirectory(prefix="roboprompt-restore-") as folder, _archive(path) as archive:
        put = _unpack(store, archive, Path(folder) / DATABASE_NAME, path)
        sqlite.require_plain(Path(folder) / DATABASE_NAME)
        snapshot = Database(f"sqlite:///{Path(folder) / DATABASE_NAME}")
        try:
            migrate(snapshot)
            with snapshot.read() as source, store.write() as target:
                _require_empty(target, with_keys=with_keys)
                if missing := blob_digests(source) - put:
                    raise CorruptDataError("backup", str(path), f"it lacks {len(missing)} blobs")
                with _row_errors(path):
                    rows = copy_rows(source, target, _left_out(source, target, with_keys=with_keys))
                    details = _restored(source, path, with_keys=with_keys)
                audit.record(target, "store.restored", path.name[:200], details)
        finally:
            snapshot.close()
    return BackupSummary(rows, len(put))


def _left_out(source: Connection, target: Connection, *, with_keys: bool) -> set[str]:
    """The tables that a restore does not bring."""
    kept = {tables.sessions.name} if with_keys else {tables.sessions.name, tables.api_keys.name}
    if audit.newest(target) is not None or not _is_whole(source):
        kept.add(tables.audit_log.name)
    return kept


def _is_whole(source: Connection) -> bool:
    try:
        for _ in audit.verified(audit.entries(source)):
            pass
    except audit.BrokenChainError as error:
        logger.warning("the backup's audit log was changed and is left out: %s", error)
        return False
    return True


def _restored(source: Connection, path: Path, *, with_keys: bool) -> dict[str, Any]:
    """What the audit log says of a restore."""
    newest = audit.newest(source)
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    keys = [record.id for record in api_keys.list_all(source)] if with_keys else []
    return {"file_sha256": digest, "its_log_ends_with": None if newest is None else newest.digest, "keys": keys}


def _require_empty(connection: Connection, *, with_keys: bool) -> None:
    ours = {tables.audit_log.name, tables.sessions.name}
    if not with_keys:
        ours.add(tables.api_keys.name)
    for table in (item for item in metadata.sorted_tables if item.name not in ours):
        if connection.scalar(select(exists(select(1).select_from(table)))):
            raise ConflictError(f"the store has something already ({table.name}): restore into an empty one")


def _unpack(store: Store, archive: tarfile.TarFile, database: Path, path: Path) -> set[str]:
    """Write the database to `database` and put the blobs; returns their digests."""
    put = set()
    for member in _members(archive, path):
        file = archive.extractfile(member)
        if file is None or not (member.name == DATABASE_NAME or member.name.startswith(BLOB_PREFIX)):
            raise CorruptDataError("backup", str(path), f"{member.name!r:.200} does not belong there")
        if member.name == DATABASE_NAME:
            with database.open("wb") as copy:
                shutil.copyfileobj(file, copy)
            continue
        if member.size > MAX_BLOB_BYTES:
            raise CorruptDataError("backup", str(path), f"{member.name!r:.200} is larger than any image")
        data = file.read()
        digest = member.name.removeprefix(BLOB_PREFIX)
        if hashlib.sha256(data).hexdigest() != digest:
            raise CorruptDataError("backup", str(path), f"the bytes of {member.name} do not match its name")
        put.add(store.blobs.put(data))
    if not database.exists():
        raise CorruptDataError("backup", str(path), f"it has no {DATABASE_NAME}")
    return put


def _members(archive: tarfile.TarFile, path: Path) -> Iterator[tarfile.TarInfo]:
    """The archive's members, which must be plain files: links, devices and files with holes are none of a backup's."""
    while True:
        try:
            member = archive.next()
        except (KeyError, ValueError, OverflowError, RecursionError, EOFError, TypeError) as error:
            raise CorruptDataError("backup", str(path), f"its headers make no sense: {error!r:.200}") from error
        if member is None:
            return
        if not member.isreg() or member.issparse() or member.size < 0:
            raise CorruptDataError(
                "backup", str(path), f"{member.name!r:.200} is no plain file: it does not belong there"
            )
        yield member


@contextmanager
def _archive(path: Path) -> Iterator[tarfile.TarFile]:
    try:
        with disk_errors(), tarfile.open(path, "r:") as archive:
            yield archive
    except tarfile.TarError as error:
        raise CorruptDataError("backup", str(path), str(error)) from error


@contextmanager
def _row_errors(path: Path) -> Iterator[None]:
    """Rows that no service has written: they contradict each other, or hold no JSON."""
    try:
        yield
    except exc.OperationalError:  # the disk is full, or the server gone
        raise
    except (exc.SQLAlchemyError, ValueError, TypeError) as error:
        reason = f"its rows are not as they should be: {str(error).splitlines()[0]:.200}"
        raise CorruptDataError("backup", str(path), reason) from error
