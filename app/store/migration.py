"""Bring a database to the newest schema, by Alembic, from code."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, inspect

from app.store import sqlite
from app.store.database import Database, begin_write
from app.store.errors import SchemaVersionError
from roboprompt_client.version import VERSION


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
            f"database {database.name} is at revision {', '.join(sorted(unknown))}, which {this} does not know: a "
            "newer version wrote it, or one before 1.0. Install that version, or use another folder"
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
                from app.store import postgres

                postgres.lock_for_migration(connection)
            yield connection
            if database.is_sqlite:
                sqlite.check_foreign_keys(connection)
