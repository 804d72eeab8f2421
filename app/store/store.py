"""Database and blobs of one data directory, opened together."""

import fcntl
import time
from contextlib import AbstractContextManager
from datetime import timedelta
from pathlib import Path
from typing import Self, TextIO

from sqlalchemy import Connection, Text, cast, select

from app.store import tables
from app.store.blobs import BlobStore, FileBlobStore, digests_in
from app.store.data_folder import private_folder, private_opener
from app.store.database import SERVER_CONNECTIONS, Database, migrate
from app.store.errors import StoreUnavailableError, disk_errors

DATABASE_NAME = "roboprompt.db"
# An upload commits its row within seconds of putting its blobs.
SWEEP_GRACE = timedelta(hours=1)


class Store:
    """Episodes, tasks and predictions. Safe for concurrent use; synchronous: call it in a thread.

    The modules beside this one hold the queries. Each takes the connection of `read()` or `write()`, so that one
    transaction can hold several of them::

        with store.write() as connection:
            task = tasks.get_or_create(connection, name, settings)
            episode = episodes.add(connection, draft)

    Attributes:
        blobs: images; put them before the row that refers to them is committed.
    """

    def __init__(self, database: Database, blobs: BlobStore, data_dir: Path) -> None:
        self._database = database
        self._data_dir = data_dir
        self.blobs = blobs

    @classmethod
    def open(
        cls,
        data_dir: Path,
        database_url: str | None = None,
        blobs_url: str | None = None,
        *,
        server_connections: int = SERVER_CONNECTIONS,
    ) -> Self:
        """Open or create the store and bring its database to the newest schema.

        Args:
            data_dir: created if it is not there, and closed to other users; holds the blobs, and the database unless
                `database_url` names another.
            blobs_url: of an object store, e.g. ``s3://bucket/prefix``; None: a folder of the data directory.
            server_connections: largest number of connections to a database server.

        Raises:
            StoreUnavailableError: if directory or database cannot be opened, created, locked or closed to others.
            SchemaVersionError: if the database was written by newer code.
        """
        private_folder(data_dir)
        url = database_url or f"sqlite:///{data_dir / DATABASE_NAME}"
        database = Database(url, server_connections=server_connections)
        try:
            migrate(database)
            return cls(database, _open_blobs(blobs_url, data_dir), data_dir)
        except BaseException:
            database.close()
            raise

    def read(self) -> AbstractContextManager[Connection]:
        return self._database.read()

    def write(self) -> AbstractContextManager[Connection]:
        return self._database.write()

    def copy_database(self, path: Path) -> None:
        """Write the database of one moment to a new file; raises as `Database.copy`."""
        self._database.copy(path)

    def ping(self) -> None:
        with self.read() as connection:
            connection.execute(select(tables.tasks.c.name).limit(1)).first()

    def sweep(self, older_than: timedelta = SWEEP_GRACE) -> int:
        """Remove the blobs that no row refers to and that were put longer ago; returns how many."""
        with self.read() as connection:
            referenced = blob_digests(connection)
        return self.blobs.sweep(referenced, older_than)

    def sweep_once(self) -> int:
        """`sweep`, unless another process of this data folder does it or has done it within the hour."""
        path = self._data_dir / ".swept"
        with disk_errors("data folder"), open(path, "a+", opener=private_opener) as note:
            try:
                fcntl.flock(note, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return 0
            if 0 <= time.time() - _written_s(note) < SWEEP_GRACE.total_seconds():
                return 0
            removed = self.sweep()
            note.truncate(0)
            note.write(str(time.time()))
            return removed

    def close(self) -> None:
        self._database.close()


def _written_s(note: TextIO) -> float:
    """Return the time that the note holds, or 0 if it has none or a crash damaged it."""
    note.seek(0)
    try:
        return float(note.read())
    except ValueError:
        return 0.0


def _open_blobs(url: str | None, data_dir: Path) -> BlobStore:
    if not url:
        return FileBlobStore(data_dir / "blobs")
    try:
        from app.store.object_store import ObjectBlobStore
    except ModuleNotFoundError as error:
        raise StoreUnavailableError(f"{error}; {url} needs `pip install roboprompt[s3]`") from error
    return ObjectBlobStore(url)


def blob_digests(connection: Connection) -> set[str]:
    """The digests of all images of episodes, predictions and labels, and of settings' templates.

    Found in the text of the JSON: to decode that of 100,000 episodes takes ten seconds in which other threads starve.
    """
    digests: set[str] = set()
    images = (tables.episodes.c.cameras, tables.predictions.c.cameras, tables.labels.c.cameras)
    for column in (*images, tables.tasks.c.settings):
        query = select(cast(column, Text)).where(column.is_not(None)).execution_options(yield_per=1000)
        digests.update(digests_in(connection.scalars(query)))
    return digests
