"""Engine, transactions, and the one place where the database's errors become ours. Synchronous: call it in a thread."""

import json
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial

from sqlalchemy import Connection, QueuePool, create_engine, exc

from app.store import sqlite
from app.store.errors import CorruptDataError, StoreUnavailableError

BUSY_TIMEOUT_S = 10.0
# As many as anyio's thread pool has threads by default: no caller waits for a connection.
MAX_CONNECTIONS = 40


class Database:
    """A pool of connections to one database; nothing is opened or created before the first use.

    Args:
        url: SQLAlchemy's, e.g. ``sqlite:////var/lib/roboprompt/roboprompt.db``.
        busy_timeout_s: how long a writer waits for the others before StoreUnavailableError.

    Attributes:
        is_sqlite: whether `app.store.sqlite` applies.
    """

    def __init__(self, url: str, busy_timeout_s: float = BUSY_TIMEOUT_S) -> None:
        self.engine = create_engine(
            url,
            poolclass=QueuePool,
            pool_size=MAX_CONNECTIONS,
            max_overflow=0,
            pool_timeout=busy_timeout_s,
            json_serializer=partial(json.dumps, allow_nan=False, separators=(",", ":")),
        )
        self.name = self.engine.url.render_as_string(hide_password=True)
        self.busy_timeout_s = busy_timeout_s
        self.is_sqlite = self.engine.dialect.name == "sqlite"
        if self.is_sqlite:
            sqlite.configure(self.engine, busy_timeout_s)
        self._writers = sqlite.WriterQueue(busy_timeout_s) if self.is_sqlite else None

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A transaction that sees one state of the database throughout.

        Raises:
            StoreUnavailableError, CorruptDataError: see `errors`.
        """
        with self.errors(), self.engine.connect() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction that is alone in writing: committed at the end, rolled back by any exception. Do not nest.

        Raises:
            StoreUnavailableError, CorruptDataError: see `errors`.
        """
        with self.errors(), self._turn(), self.engine.connect() as connection, begin_write(connection):
            yield connection

    def close(self) -> None:
        """Close every connection."""
        self.engine.dispose()

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Map the database's failures.

        Raises:
            StoreUnavailableError: full, locked, read-only or unreachable.
            CorruptDataError: the file is damaged or no database at all.
        """
        try:
            yield
        except exc.OperationalError as error:
            raise StoreUnavailableError(f"database {self.name}: {error.orig}") from error
        except exc.TimeoutError as error:
            raise StoreUnavailableError(
                f"database {self.name}: all {MAX_CONNECTIONS} connections are in use"
            ) from error
        except exc.DatabaseError as error:
            # SQLite reports a damaged file by the base class; the subclasses are mistakes of ours.
            if type(error) is not exc.DatabaseError:
                raise
            raise CorruptDataError("database", self.name, str(error.orig)) from error

    def _turn(self) -> AbstractContextManager[None]:
        return self._writers.turn() if self._writers else nullcontext()


@contextmanager
def begin_write(connection: Connection) -> Iterator[None]:
    """Begin on `connection` with the write lock, so that what is read inside still holds at the commit."""
    with connection.execution_options(**{sqlite.WRITE_OPTION: True}).begin():
        yield
