"""All that is special to SQLite. Nothing outside this module knows a pragma."""

import contextlib
import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import cast

from sqlalchemy import Connection, Engine, event
from sqlalchemy.pool import ConnectionPoolEntry

from app.store.data_folder import private_file
from app.store.errors import CorruptDataError, StoreUnavailableError

# Execution option of a connection whose transaction will write.
WRITE_OPTION = "roboprompt_write"
# Of each connection, of which there are up to 40; the operating system caches the file for all of them together.
CACHE_KIB = 256
_WAL_RETRY_INTERVAL_S = 0.02


def configure(engine: Engine, busy_timeout_s: float) -> None:
    """Durable commits, enforced foreign keys, and transactions that take the write lock before they read.

    Durability: synchronous=FULL syncs the log at every commit, so that an acknowledged commit survives a power cut;
    NORMAL would lose those since the last checkpoint (https://sqlite.org/pragma.html#pragma_synchronous).
    """
    pragmas = (
        f"busy_timeout={round(busy_timeout_s * 1000)}",
        "synchronous=FULL",
        "foreign_keys=ON",
        f"cache_size=-{CACHE_KIB}",
    )

    @event.listens_for(engine, "do_connect")
    def on_opening(_dialect: object, _record: object, arguments: Sequence[str], _parameters: object) -> None:
        # SQLite would make the file readable for all; the log and the index beside it get the file's mode.
        if arguments[0] != ":memory:":
            with contextlib.suppress(OSError):  # which SQLite reports itself
                private_file(Path(arguments[0]))

    @event.listens_for(engine, "connect")
    def on_connect(connection: sqlite3.Connection, _: ConnectionPoolEntry) -> None:
        connection.isolation_level = None  # the driver's own BEGIN comes too late for reads and for DDL
        for pragma in pragmas:
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def on_begin(connection: Connection) -> None:
        # A transaction that reads first and takes the lock later fails at once if another wrote in between.
        writes = connection.get_execution_options().get(WRITE_OPTION, False)
        if writes:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
        else:  # which takes no lock, so that no failure of it must be mapped
            cast(sqlite3.Connection, connection.connection.dbapi_connection).execute("BEGIN")


@contextmanager
def writers_turn(writers: threading.Lock, timeout_s: float) -> Iterator[None]:
    """Wait for the other writers of this process; raises StoreUnavailableError.

    SQLite itself makes a writer sleep and try again, for up to 0.1 s a time and in no order: with 32 threads that
    uploaded, the slowest waited for 2.3 s instead of 0.4 s, and half as many uploads were done in a second.
    """
    if not writers.acquire(timeout=timeout_s):
        raise StoreUnavailableError(f"the database was busy with other writers for {timeout_s:g} s")
    try:
        yield
    finally:
        writers.release()


def prepare_for_migration(connection: Connection, timeout_s: float) -> None:
    """Switch the file to WAL (once and for all) and this connection's foreign keys off.

    With foreign keys on, altering a table, which SQLite does by copying it and dropping the original, would fail or
    delete the rows that refer to it (https://sqlite.org/lang_altertable.html#otheralter).

    Raises:
        StoreUnavailableError: where WAL is impossible (network file systems, databases in memory).
    """
    driver = cast(sqlite3.Connection, connection.connection.dbapi_connection)
    mode = _switch_to_wal(driver, timeout_s)
    if mode != "wal":
        raise StoreUnavailableError(
            f"SQLite stays in journal mode {mode!r}: keep the database in a file on a local disk"
        )
    driver.execute("PRAGMA foreign_keys=OFF")


def _switch_to_wal(driver: sqlite3.Connection, timeout_s: float) -> str:
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            return str(driver.execute("PRAGMA journal_mode=WAL").fetchone()[0])
        except sqlite3.OperationalError as error:
            # SQLite does not wait by itself when several processes switch a new file at once.
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or time.monotonic() > deadline:
                raise StoreUnavailableError(f"SQLite cannot switch the database to WAL: {error}") from error
        time.sleep(_WAL_RETRY_INTERVAL_S)


def check_foreign_keys(connection: Connection) -> None:
    """Raise CorruptDataError if a row refers to one that is not there."""
    if row := connection.exec_driver_sql("PRAGMA foreign_key_check").first():
        raise CorruptDataError(
            "database", str(connection.engine.url), f"row {row[1]} of {row[0]} refers to no {row[2]}"
        )


def vacuum_into(engine: Engine, path: Path) -> None:
    """Write the database of one moment to a new file; raises StoreUnavailableError.

    The statement must not stand in a transaction (https://sqlite.org/lang_vacuum.html#vacuuminto).
    """
    with contextlib.closing(engine.raw_connection()) as connection:
        try:
            cast(sqlite3.Connection, connection.dbapi_connection).execute("VACUUM INTO ?", [str(path)])
        except sqlite3.Error as error:
            raise StoreUnavailableError(f"the database cannot be copied: {error}") from error
