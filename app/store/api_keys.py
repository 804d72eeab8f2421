"""API keys, and the browsers that have logged in with one; only digests are stored.

Each query runs on the caller's transaction.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, delete, insert, or_, select, update

from app.store import tables
from app.store.errors import NotFoundError

_KEYS, _SESSIONS = tables.api_keys, tables.sessions
MAX_SESSIONS = 50  # of a key; the oldest beyond ends


@dataclass(frozen=True)
class ApiKeyRecord:
    """A key as it is stored."""

    id: str  # the public part of the key
    name: str
    digest: str  # SHA-256 of the whole key, in hexadecimal
    scopes: tuple[str, ...]
    created_at: datetime
    revoked_at: datetime | None = None  # None while the key is valid
    tasks: tuple[str, ...] | None = None  # the only ones that the key is for; None: any
    expires_at: datetime | None = None  # from then on it is refused; None: never
    last_used_at: datetime | None = None  # to about a minute; None: never


def add(connection: Connection, record: ApiKeyRecord) -> None:
    """Store a new key."""
    connection.execute(insert(_KEYS).values(vars(record)))


def list_all(connection: Connection) -> tuple[ApiKeyRecord, ...]:
    """Every key, oldest first, revoked ones included."""
    rows = connection.execute(select(_KEYS).order_by(_KEYS.c.created_at, _KEYS.c.id))
    return tuple(ApiKeyRecord(**row._mapping) for row in rows)


def valid(connection: Connection) -> tuple[ApiKeyRecord, ...]:
    """Every key that is not revoked, expired ones included."""
    return tuple(record for record in list_all(connection) if record.revoked_at is None)


def name_of(connection: Connection, key_id: str | None) -> str | None:
    """The name of a key; None if there is no such key."""
    return connection.scalar(select(_KEYS.c.name).where(_KEYS.c.id == key_id))


def revoke(connection: Connection, key_id: str) -> None:
    """Revoke a key; revoking it twice changes nothing. Raises NotFoundError."""
    if name_of(connection, key_id) is None:
        raise NotFoundError("API key", key_id)
    query = update(_KEYS).where(_KEYS.c.id == key_id, _KEYS.c.revoked_at.is_(None))
    if connection.execute(query.values(revoked_at=datetime.now(UTC))).rowcount:
        connection.execute(delete(_SESSIONS).where(_SESSIONS.c.key_id == key_id))


def note_use(connection: Connection, key_id: str, within: timedelta) -> None:
    """Store that the key is used now, unless a use `within` this time is stored already."""
    now, last = datetime.now(UTC), _KEYS.c.last_used_at
    query = update(_KEYS).where(_KEYS.c.id == key_id, or_(last.is_(None), last <= now - within))
    connection.execute(query.values(last_used_at=now))


def begin_session(connection: Connection, digest: str, key_id: str, expires_at: datetime) -> None:
    """Store a session by its cookie's digest; expired ones go, and so does the key's oldest if there are too many."""
    now = datetime.now(UTC)
    connection.execute(delete(_SESSIONS).where(_SESSIONS.c.expires_at <= now))
    newest = select(_SESSIONS.c.digest).where(_SESSIONS.c.key_id == key_id).order_by(_SESSIONS.c.created_at.desc())
    if beyond := list(connection.scalars(newest.offset(MAX_SESSIONS - 1))):
        connection.execute(delete(_SESSIONS).where(_SESSIONS.c.digest.in_(beyond)))
    values = {"digest": digest, "key_id": key_id, "created_at": now, "expires_at": expires_at}
    connection.execute(insert(_SESSIONS).values(values))


def key_of_session(connection: Connection, digest: str) -> str | None:
    """The id of the key that the session was begun with; None if there is no such session, or it has expired."""
    query = select(_SESSIONS.c.key_id).where(_SESSIONS.c.digest == digest, _SESSIONS.c.expires_at > datetime.now(UTC))
    return connection.scalar(query)


def end_session(connection: Connection, digest: str) -> None:
    """Forget the session, if there is one."""
    connection.execute(delete(_SESSIONS).where(_SESSIONS.c.digest == digest))
