"""Database and blobs of one data directory, opened together."""

from contextlib import AbstractContextManager
from datetime import timedelta
from pathlib import Path
from typing import Self

from sqlalchemy import Connection, select

from app.store import episodes, tables
from app.store.blobs import BlobStore, FileBlobStore
from app.store.database import Database
from app.store.errors import StoreUnavailableError
from app.store.migration import migrate

# An upload commits its row within seconds of putting its blobs.
SWEEP_GRACE = timedelta(hours=1)


class Store:
    """Episodes, tasks and predictions. Safe for concurrent use; synchronous: call it in a thread.

    Queries are functions in `tasks`, `episodes`, `predictions` and `idempotency`; each takes the connection of `read()`
    or `write()`, so that a use case puts several of them into one transaction::

        with store.write() as connection:
            task = tasks.get_or_create(connection, name, settings)
            episode = episodes.add(connection, draft)

    Attributes:
        blobs: images; put them before the row that refers to them is committed.
    """

    def __init__(self, database: Database, blobs: BlobStore) -> None:
        self._database = database
        self.blobs = blobs

    @classmethod
    def open(cls, data_dir: Path, database_url: str | None = None) -> Self:
        """Open or create the store and bring its database to the newest schema.

        Args:
            data_dir: created if it is not there; holds the blobs, and the database unless `database_url` names another.

        Raises:
            StoreUnavailableError: if directory or database cannot be opened, created or locked.
            SchemaVersionError: if the database was written by newer code.
        """
        try:
            data_dir.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreUnavailableError(f"data directory: {error}") from error
        database = Database(database_url or f"sqlite:///{data_dir / 'roboprompt.db'}")
        try:
            migrate(database)
            return cls(database, FileBlobStore(data_dir / "blobs"))
        except BaseException:
            database.close()
            raise

    def read(self) -> AbstractContextManager[Connection]:
        """A transaction that sees one state throughout; see `Database.read`."""
        return self._database.read()

    def write(self) -> AbstractContextManager[Connection]:
        """A transaction alone in writing: committed at the end, or rolled back; see `Database.write`."""
        return self._database.write()

    def ping(self) -> None:
        """Make sure that the database answers.

        Raises:
            StoreUnavailableError: if it does not.
        """
        with self.read() as connection:
            connection.execute(select(tables.tasks.c.name).limit(1)).first()

    def sweep(self, older_than: timedelta = SWEEP_GRACE) -> int:
        """Remove the blobs that no episode or prediction refers to and that were put longer ago; returns how many."""
        with self.read() as connection:
            referenced = episodes.blob_digests(connection)
        return self.blobs.sweep(referenced, older_than)

    def close(self) -> None:
        """Close every connection."""
        self._database.close()
