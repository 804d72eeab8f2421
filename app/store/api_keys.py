"""API keys, of which only digests are stored. Each query runs on the caller's transaction."""

from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, insert, select, update

from app.store import tables
from app.store.errors import NotFoundError

_KEYS = tables.api_keys


@dataclass(frozen=True)
class ApiKeyRecord:
    """A key as it is stored."""

    id: str  # the public part of the key
    name: str
    digest: str  # SHA-256 of the whole key, in hexadecimal
    scope: str
    created_at: datetime
    revoked_at: datetime | None = None  # None while the key is valid


def add(connection: Connection, record: ApiKeyRecord) -> None:
    """Store a new key."""
    connection.execute(insert(_KEYS).values(vars(record)))


def list_all(connection: Connection) -> tuple[ApiKeyRecord, ...]:
    """Every key, oldest first, revoked ones included."""
    rows = connection.execute(select(_KEYS).order_by(_KEYS.c.created_at, _KEYS.c.id))
    return tuple(ApiKeyRecord(**row._mapping) for row in rows)


def valid(connection: Connection) -> tuple[ApiKeyRecord, ...]:
    """Every key that is not revoked."""
    return tuple(record for record in list_all(connection) if record.revoked_at is None)


def revoke(connection: Connection, key_id: str) -> None:
    """Revoke a key; revoking it twice changes nothing. Raises NotFoundError."""
    if connection.scalar(select(_KEYS.c.id).where(_KEYS.c.id == key_id)) is None:
        raise NotFoundError("API key", key_id)
    query = update(_KEYS).where(_KEYS.c.id == key_id, _KEYS.c.revoked_at.is_(None))
    connection.execute(query.values(revoked_at=datetime.now(UTC)))
