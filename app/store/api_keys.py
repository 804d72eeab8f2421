"""API keys, of which only digests are stored. Each query runs on the caller's transaction."""

from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, insert, select, update

from app.store import audit, tables
from app.store.errors import NotFoundError

_KEYS = tables.api_keys


@dataclass(frozen=True)
class ApiKeyRecord:
    """A key as it is stored.

    Attributes:
        id: the public part of the key.
        digest: SHA-256 of the whole key, in hexadecimal.
        revoked_at: None while the key is valid.
    """

    id: str
    name: str
    digest: str
    scopes: tuple[str, ...]
    created_at: datetime
    revoked_at: datetime | None = None


def add(connection: Connection, record: ApiKeyRecord) -> None:
    """Store a new key."""
    connection.execute(insert(_KEYS).values({**asdict(record), "scopes": list(record.scopes)}))
    audit.record(connection, "key.created", record.id, {"name": record.name, "scopes": list(record.scopes)})


def list_all(connection: Connection) -> tuple[ApiKeyRecord, ...]:
    """Every key, oldest first, revoked ones included."""
    rows = connection.execute(select(_KEYS).order_by(_KEYS.c.created_at, _KEYS.c.id))
    return tuple(ApiKeyRecord(**{**row._mapping, "scopes": tuple(row.scopes)}) for row in rows)


def valid(connection: Connection) -> tuple[ApiKeyRecord, ...]:
    """Every key that is not revoked."""
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
        audit.record(connection, "key.revoked", key_id, {"name": name})
