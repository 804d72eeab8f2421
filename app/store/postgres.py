"""All that is special to PostgreSQL. Its driver, psycopg, is installed only with the extra `postgres`."""

from sqlalchemy import Connection, Engine, event, exc, func, select
from sqlalchemy.pool import ConnectionPoolEntry

# https://www.postgresql.org/docs/current/errcodes-appendix.html
_READ_ONLY = "25006"  # a standby, or a database that its operator made read-only
_CORRUPTED = ("XX001", "XX002")
# Readers see one state throughout; psycopg sends both with the BEGIN, without another round trip.
READ_OPTIONS = {"isolation_level": "REPEATABLE READ", "postgresql_readonly": True}
_MIGRATION_LOCK = "roboprompt migration"
_MIGRATION_LOCK_TIMEOUT = "10min"  # another process may be rewriting a large table


def configure(engine: Engine, lock_timeout_s: float) -> None:
    """Durable commits, bounded waits for locks, and texts with NUL."""
    import psycopg
    from psycopg.adapt import Buffer
    from psycopg.types.string import StrDumper

    class NulFreeDumper(StrDumper):
        """PostgreSQL stores no NUL: U+FFFD takes its place, so that what is asked for with one is not found."""

        def dump(self, obj: str) -> Buffer | None:
            return super().dump(obj.replace("\0", "\N{REPLACEMENT CHARACTER}"))

    settings = (f"lock_timeout = {round(lock_timeout_s * 1000)}", "synchronous_commit = on")

    @event.listens_for(engine, "connect")
    def on_connect(connection: psycopg.Connection, _: ConnectionPoolEntry) -> None:
        connection.adapters.register_dumper(str, NulFreeDumper)
        for setting in settings:
            connection.execute(f"SET {setting}")
        connection.commit()


def lock(connection: Connection, name: str) -> None:
    """Wait until no other transaction holds the lock `name`; released at this one's end."""
    connection.execute(select(func.pg_advisory_xact_lock(func.hashtextextended(name, 0))))


def lock_for_migration(connection: Connection) -> None:
    """Let one process migrate at a time."""
    connection.exec_driver_sql(f"SET LOCAL lock_timeout = '{_MIGRATION_LOCK_TIMEOUT}'")
    lock(connection, _MIGRATION_LOCK)


def meaning(error: exc.DatabaseError) -> tuple[bool, bool, str]:
    """Whether a later attempt may succeed, whether the server's files are damaged, and what it says.

    Only errors that the driver does not count among the operational ones are distinguished. Of a failed connection it
    says no more than that: the rest names host, port and user.
    """
    state: str | None = getattr(error.orig, "sqlstate", None)
    message: str | None = getattr(getattr(error.orig, "diag", None), "message_primary", None)
    return state == _READ_ONLY, state in _CORRUPTED, message or str(error.orig).partition(":")[0]
