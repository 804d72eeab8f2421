"""Browsers that have logged in: digests of what their cookies hold. Each query runs on the caller's transaction."""

from datetime import UTC, datetime

from sqlalchemy import Connection, delete, insert, select

from app.store import tables

_SESSIONS = tables.sessions
MAX_OF_A_KEY = 50  # the oldest beyond ends


def begin(connection: Connection, digest: str, key_id: str, expires_at: datetime) -> None:
    """Store a session; those that have expired go, and so does the key's oldest where there are too many."""
    now = datetime.now(UTC)
    connection.execute(delete(_SESSIONS).where(_SESSIONS.c.expires_at <= now))
    newest = select(_SESSIONS.c.digest).where(_SESSIONS.c.key_id == key_id).order_by(_SESSIONS.c.created_at.desc())
    if beyond := list(connection.scalars(newest.offset(MAX_OF_A_KEY - 1))):
        connection.execute(delete(_SESSIONS).where(_SESSIONS.c.digest.in_(beyond)))
    values = {"digest": digest, "key_id": key_id, "created_at": now, "expires_at": expires_at}
    connection.execute(insert(_SESSIONS).values(values))


def key_of(connection: Connection, digest: str) -> str | None:
    """The id of the key that the session was begun with; None if there is no such session, or it has expired."""
    query = select(_SESSIONS.c.key_id).where(_SESSIONS.c.digest == digest, _SESSIONS.c.expires_at > datetime.now(UTC))
    return connection.scalar(query)


def end(connection: Connection, digest: str) -> None:
    """Forget the session, if there is one."""
    connection.execute(delete(_SESSIONS).where(_SESSIONS.c.digest == digest))


def end_all_of(connection: Connection, key_id: str) -> None:
    """Forget every session of a key."""
    connection.execute(delete(_SESSIONS).where(_SESSIONS.c.key_id == key_id))
