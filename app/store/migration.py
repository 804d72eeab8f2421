"""Bring a database to the newest schema, by Alembic, from code."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection

from app.store import sqlite
from app.store.database import Database, begin_write
from app.store.errors import SchemaVersionError


def alembic_config() -> Config:
    """The configuration that the command line uses too: `alembic -c migrations/alembic.ini`."""
    return Config(Path(__file__).resolve().parents[2] / "migrations" / "alembic.ini")


def migrate(database: Database) -> None:
    """Upgrade the database to the newest revision; all steps or none. Safe when several processes start at once.

    Raises:
        SchemaVersionError: if the database is at a revision that this code does not know.
        StoreUnavailableError: if it cannot be opened, locked or written.
    """
    config = alembic_config()
    scripts = ScriptDirectory.from_config(config)
    with database.read() as connection:
        revisions = set(MigrationContext.configure(connection).get_current_heads())
    if revisions == set(scripts.get_heads()):
        return
    if unknown := revisions - {script.revision for script in scripts.walk_revisions()}:
        raise SchemaVersionError(
            f"database {database.name} is at revision {', '.join(sorted(unknown))}, which this code "
            f"({scripts.get_current_head()}) does not know: install the version that wrote it, or use another folder"
        )
    with migration_transaction(database) as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "head")


@contextmanager
def migration_transaction(database: Database) -> Iterator[Connection]:
    """The write lock for one process's migration; the others wait and then find the work done."""
    with database.errors(), database.engine.connect() as connection:
        if database.is_sqlite:
            connection.detach()  # its settings are for migrations only: it does not go back to the pool
            sqlite.prepare_for_migration(connection, database.busy_timeout_s)
        with begin_write(connection):
            if not database.is_sqlite:
                from app.store import postgres

                postgres.lock_for_migration(connection)
            yield connection
            if database.is_sqlite:
                sqlite.check_foreign_keys(connection)
