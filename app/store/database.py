"""Engine, transactions, migrations, and where the database's errors become ours. Synchronous: call it in a thread."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Engine, QueuePool, create_engine, exc, inspect, make_url

from app.store import postgres, sqlite
from app.store.errors import CorruptDataError, SchemaVersionError, StoreUnavailableError, unavailable
from roboprompt_client.version import VERSION

BUSY_TIMEOUT_S = 10.0
# As many as anyio's thread pool has threads by default: no caller waits for a connection.
SQLITE_CONNECTIONS = 40
# Of each process; a server allows 100 of all of them by default.
SERVER_CONNECTIONS = 16


class Database:
    """A pool of connections to one database; nothing is opened or created before the first use.

    Args:
        url: SQLAlchemy's, e.g. ``sqlite:////var/lib/roboprompt/roboprompt.db`` or ``postgresql://user@host/name``.
        busy_timeout_s: how long a writer waits for the others before StoreUnavailableError.
        server_connections: largest number of connections to a database server.

    Attributes:
        is_sqlite: whether `app.store.sqlite` applies; else `app.store.postgres`.

    Raises:
        StoreUnavailableError: if the URL or its driver is unknown.
    """

    def __init__(
        self, url: str, busy_timeout_s: float = BUSY_TIMEOUT_S, server_connections: int = SERVER_CONNECTIONS
    ) -> None:
        self.is_sqlite = make_url(url).get_backend_name() == "sqlite"
        self.max_connections = SQLITE_CONNECTIONS if self.is_sqlite else server_connections
        self.engine = _engine(url, self.max_connections, busy_timeout_s, ping=not self.is_sqlite)
        self.name = self.engine.url.render_as_string(hide_password=True)
        self.busy_timeout_s = busy_timeout_s
        self._readers, self._writers = self.engine, threading.Lock()
        if self.is_sqlite:
            sqlite.configure(self.engine, busy_timeout_s)
        else:
            postgres.configure(self.engine, busy_timeout_s)
            self._readers = self.engine.execution_options(**postgres.READ_OPTIONS)

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A transaction that sees one state of the database throughout; raises as `errors`."""
        with self.errors(), self._readers.connect() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction that writes: committed at the end, rolled back by any exception; raises as `errors`.

        Do not nest it. On SQLite it is alone in writing. On PostgreSQL what it reads may change before its commit
        unless it holds a lock: that of the task (`tasks.lock`, `tasks.get_or_create`), or one of `lock`.
        """
        turn = sqlite.writers_turn(self._writers, self.busy_timeout_s) if self.is_sqlite else nullcontext()
        with self.errors(), turn, self.engine.connect() as connection, begin_write(connection):
            yield connection

    def copy(self, path: Path) -> None:
        """Write a copy of one moment to a new file.

        Raises:
            StoreUnavailableError: if it cannot be written; for PostgreSQL, which has tools of its own.
        """
        if not self.is_sqlite:
            raise StoreUnavailableError("the database is PostgreSQL: back it up with pg_dump, and the blobs beside it")
        sqlite.vacuum_into(self.engine, path)

    def close(self) -> None:
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
        except exc.TimeoutError as error:
            raise unavailable("database", f"all {self.max_connections} connections are in use", self.name) from error
        except exc.DatabaseError as error:
            raise self._meaning(error) from error

    def _meaning(self, error: exc.DatabaseError) -> Exception:
        """What an error of the driver means to callers, without the database's place; which is in the log."""
        if self.is_sqlite:
            # SQLite reports a damaged file by the base class; the other subclasses are mistakes of ours.
            passing, damaged, reason = False, type(error) is exc.DatabaseError, str(error.orig)
        else:
            passing, damaged, reason = postgres.meaning(error)
        if passing or isinstance(error, exc.OperationalError):
            return unavailable("database", reason, f"{self.name}: {error.orig}")
        file_name = Path(self.engine.url.database or "").name
        return CorruptDataError("database", file_name, reason) if damaged else error


def _engine(url: str, connections: int, timeout_s: float, *, ping: bool) -> Engine:
    """The engine; `ping` tries a connection before it is used, so that a restart of the server breaks no request."""
    options: dict[str, Any] = {
        "poolclass": QueuePool,
        "pool_size": connections,
        "max_overflow": 0,
        "pool_timeout": timeout_s,
        "pool_pre_ping": ping,
        "json_serializer": partial(json.dumps, allow_nan=False, separators=(",", ":")),
    }
    try:
        return create_engine(url, **options)
    except (ModuleNotFoundError, exc.NoSuchModuleError) as error:
        remedy = "postgresql://... needs `pip install roboprompt[postgres]`; SQLite needs nothing"
        raise StoreUnavailableError(f"database URL: {error}; {remedy}") from error


def lock(connection: Connection, name: str) -> None:
    """Keep other transactions out that take the lock `name`, until this one ends; call it in a write transaction."""
    if connection.dialect.name != "sqlite":  # where writers are alone anyway
        postgres.lock(connection, name)


def writes(connection: Connection) -> bool:
    """Whether `connection` is in a write transaction."""
    return bool(connection.get_execution_options().get(sqlite.WRITE_OPTION, False))


@contextmanager
def begin_write(connection: Connection) -> Iterator[None]:
    """Begin on `connection` with the write lock, so that what is read inside still holds at the commit."""
    with connection.execution_options(**{sqlite.WRITE_OPTION: True}).begin():
        yield


def alembic_config() -> Config:
    """The configuration that the command line uses too: `alembic -c migrations/alembic.ini`."""
    return Config(Path(__file__).resolve().parents[2] / "migrations" / "alembic.ini")


def migrate(database: Database) -> None:
    """Upgrade the database to the newest revision; all steps or none. Safe when several processes start at once.

    Raises:
        SchemaVersionError: if the database is at a revision that this code does not know, or is another program's.
        StoreUnavailableError: if it cannot be opened, locked or written.
    """
    config = alembic_config()
    if is_newest(database):
        return
    with migration_transaction(database) as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "head")


def is_newest(database: Database) -> bool:
    """Whether the database has the newest schema; changes nothing. Raises as `migrate`."""
    scripts = ScriptDirectory.from_config(alembic_config())
    with database.read() as connection:
        revisions = set(MigrationContext.configure(connection).get_current_heads())
        tables = set(inspect(connection).get_table_names()) - {"alembic_version"}
    if revisions == set(scripts.get_heads()):
        return True
    this = f"RoboPrompt {VERSION} (revision {scripts.get_current_head()})"
    if unknown := revisions - {script.revision for script in scripts.walk_revisions()}:
        raise SchemaVersionError(
            f"database {database.name} is at revision {', '.join(sorted(unknown))}, which {this} does not know: "
            "another version wrote it. Install that version, or use another folder"
        )
    if tables and not revisions:
        raise SchemaVersionError(
            f"database {database.name} has tables ({', '.join(sorted(tables)[:3])}) and no revision: no version of "
            "RoboPrompt wrote it. Use another folder or database"
        )
    return False


@contextmanager
def migration_transaction(database: Database) -> Iterator[Connection]:
    """The write lock for one process's migration; the others wait and then find the work done."""
    with database.errors(), database.engine.connect() as connection:
        if database.is_sqlite:
            connection.detach()  # its settings are for migrations only: it does not go back to the pool
            sqlite.prepare_for_migration(connection, database.busy_timeout_s)
        with begin_write(connection):
            if not database.is_sqlite:
                postgres.lock_for_migration(connection)
            yield connection
            if database.is_sqlite:
                sqlite.check_foreign_keys(connection)
