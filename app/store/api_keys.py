"""API keys, of which only digests are stored. Each query runs on the caller's transaction."""

from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Connection, Row, insert, or_, select, update

from app.store import audit, sessions, tables
from app.store.errors import NotFoundError

_KEYS = tables.api_keys


@dataclass(frozen=True)
class ApiKeyRecord:
    """A key as it is stored.

    Attributes:
        id: the public part of the key.
        digest: SHA-256 of the whole key, in hexadecimal.
        revoked_at: None while the key is valid.
        tasks: the only ones that the key is for; None: any.
        expires_at: from then on it is refused; None: never.
        last_used_at: to about a minute; None: never.
    """

    id: str
    name: str
    digest: str
    scopes: tuple[str, ...]
    created_at: datetime
    revoked_at: datetime | None = None
    tasks: tuple[str, ...] | None = None
    expires_at: datetime | None = None
    last_used_at: datetime | None = None


def add(connection: Connection, record: ApiKeyRecord) -> None:
    """Store a new key."""
    scopes, tasks = list(record.scopes), None if record.tasks is None else list(record.tasks)
    connection.execute(insert(_KEYS).values({**asdict(record), "scopes": scopes, "tasks": tasks}))
    limits = {"tasks": tasks, "expires_at": None if record.expires_at is None else record.expires_at.isoformat()}
    said = {name: value for name, value in limits.items() if value is not None}
    audit.record(connection, "key.created", record.id, {"name": record.name, "scopes": scopes, **said})


def list_all(connection: Connection) -> tuple[ApiKeyRecord, ...]:
    """Every key, oldest first, revoked ones included."""
    rows = connection.execute(select(_KEYS).order_by(_KEYS.c.created_at, _KEYS.c.id))
    return tuple(_record(row) for row in rows)


def valid(connection: Connection) -> tuple[ApiKeyRecord, ...]:
    """Every key that is not revoked, expired ones included."""
    return tuple(record for record in list_all(connection) if record.revoked_at is None)


def revoke(connection: Connection, key_id: str) -> None:
    """Take a key back; revoking twice changes nothing.

    Raises:
        NotFoundError: if there is no key of that id.
    """
    name: str | None = connection.scalar(select(_KEYS.c.name).where(_KEYS.c.id == key_id))
    if name is None:
        raise NotFoundError("API key", key_id)
    query = update(_KEYS).where(_KEYS.c.id == key_id, _KEYS.c.revoked_at.is_(None))
    if connection.execute(query.values(revoked_at=datetime.now(UTC))).rowcount:
        sessions.end_all_of(connection, key_id)
        audit.record(connection, "key.revoked", key_id, {"name": name})


def note_use(connection: Connection, key_id: str, within: timedelta) -> None:
    """Write down that the key is used now, unless that was written down `within` this time already."""
    now, last = datetime.now(UTC), _KEYS.c.last_used_at
    query = update(_KEYS).where(_KEYS.c.id == key_id, or_(last.is_(None), last <= now - within))
    connection.execute(query.values(last_used_at=now))


def _record(row: Row[Any]) -> ApiKeyRecord:
    tasks = None if row.tasks is None else tuple(row.tasks)
    return ApiKeyRecord(**{**row._mapping, "scopes": tuple(row.scopes), "tasks": tasks})
