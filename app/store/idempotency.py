"""Answers to requests that carried an `Idempotency-Key`. Each query runs on the caller's transaction."""

from datetime import UTC, datetime

from sqlalchemy import Connection, insert, select

from app.store import tables
from app.store.database import lock, writes
from app.store.errors import ConflictError
from app.store.records import StoredResponse

_KEYS = tables.idempotency_keys


def find(connection: Connection, scope: str, key: str, request_digest: str) -> StoredResponse | None:
    """What the same request was answered with before, or None if it is new.

    In a write transaction it waits for another one that has the same key under way.

    Args:
        scope: what the key belongs to, e.g. ``POST /episodes``.
        request_digest: of the request's content: SHA-256 in hexadecimal.

    Raises:
        ConflictError: if the key came with different content.
    """
    if writes(connection):
        lock(connection, f"{scope} {key}")
    row = connection.execute(select(_KEYS).where(_KEYS.c.scope == scope, _KEYS.c.key == key)).first()
    if row is None:
        return None
    if row.request_digest != request_digest:
        raise ConflictError(
            f"Idempotency-Key {key!r} was used for a different request: send a new key with new content"
        )
    return StoredResponse(row.status, row.response)


def save(connection: Connection, scope: str, key: str, request_digest: str, answer: StoredResponse) -> None:
    """Remember the answer. Call it after `find`, in the write transaction that does what the request asks."""
    values = {
        "scope": scope,
        "key": key,
        "request_digest": request_digest,
        "status": answer.status,
        "response": answer.response,
        "created_at": datetime.now(UTC),
    }
    connection.execute(insert(_KEYS).values(values))
