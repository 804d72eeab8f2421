"""What Alembic runs: on the connection that `app.store.database.migrate` hands over, or from the command line."""

import os
from typing import Any, Literal

from alembic import context
from alembic.util import CommandError
from sqlalchemy import Connection

from app.store.database import Database, migration_transaction
from app.store.tables import metadata
from app.store.values import UtcDateTime

URL_VARIABLE = "ROBOPROMPT_DATABASE_URL"


def database_url() -> str:
    url = context.get_x_argument(as_dictionary=True).get("url") or os.environ.get(URL_VARIABLE)
    if not url:
        raise CommandError(f"which database? pass -x url=sqlite:///path/roboprompt.db or set {URL_VARIABLE}")
    return url


def render_item(kind: str, item: Any, _: Any) -> str | Literal[False]:
    """Revisions must not import `app`: its types may change, a revision may not."""
    return "sa.DateTime(timezone=True)" if kind == "type" and isinstance(item, UtcDateTime) else False


def run(connection: Connection) -> None:
    context.configure(
        connection=connection,
        target_metadata=metadata,
        transactional_ddl=True,
        render_as_batch=True,  # SQLite alters a table by copying it
        render_item=render_item,
    )
    with context.begin_transaction():
        context.run_migrations()


def run_from_command_line() -> None:
    database = Database(database_url())
    try:
        with migration_transaction(database) as connection:
            run(connection)
    finally:
        database.close()


def print_sql() -> None:
    context.configure(url=database_url(), target_metadata=metadata, literal_binds=True, transactional_ddl=True)
    with context.begin_transaction():
        context.run_migrations()


if context.is_offline_mode():
    print_sql()
elif "connection" in context.config.attributes:
    run(context.config.attributes["connection"])
else:
    run_from_command_line()
