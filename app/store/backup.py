"""Backup of a SQLite store into one tar file: a data folder of one moment, which `tar -xf FILE -C FOLDER` unpacks.

It holds `roboprompt.db`, copied by `VACUUM INTO`, and `blobs/` with every blob that a row refers to. The service
goes on meanwhile.
"""

import tarfile
import tempfile
from contextlib import closing
from io import BytesIO
from pathlib import Path

from app.store.blobs import digest_path
from app.store.data_folder import FILE_MODE, durably_written
from app.store.database import Database
from app.store.errors import disk_errors
from app.store.store import DATABASE_NAME, Store, blob_digests


def back_up(store: Store, path: Path) -> int:
    """Write everything of one moment to `path`, which appears when it is complete and on disk.

    Returns:
        The number of blobs.

    Raises:
        StoreUnavailableError: if it cannot be written, or the database is PostgreSQL, which has its own `pg_dump`.
        CorruptDataError: if a stored blob is damaged or gone.
    """
    with disk_errors("backup"), tempfile.TemporaryDirectory(prefix="roboprompt-backup-", dir=path.parent) as folder:
        copy = Path(folder) / DATABASE_NAME
        store.copy_database(copy)
        with closing(Database(f"sqlite:///{copy}")) as database, database.read() as connection:
            digests = sorted(blob_digests(connection))
        with (
            durably_written(path, path.with_name(f".{path.name}.tmp")) as file,
            tarfile.open(fileobj=file, mode="w:") as archive,
        ):
            archive.add(copy, DATABASE_NAME)
            for digest in digests:
                data, member = store.blobs.read(digest), tarfile.TarInfo(f"blobs/{digest_path(digest)}")
                member.size, member.mode = len(data), FILE_MODE
                archive.addfile(member, BytesIO(data))
    return len(digests)
