"""Answers to requests that carried an `Idempotency-Key`. Each query runs on the caller's transaction."""

from datetime import UTC, datetime

from sqlalchemy import Connection, delete, insert, select

from app.store import tables
from app.store.errors import ConflictError
from app.store.records import StoredResponse

_KEYS = tables.idempotency_keys


def find(connection: Connection, scope: str, key: str, request_digest: str) -> StoredResponse | None:
    """What the same request was answered with before, or None if it is new.

    Args:
        scope: what the key belongs to, e.g. ``POST /episodes``.
        request_digest: of the request's content: SHA-256 in hexadecimal.

    Raises:
        ConflictError: if the key came with different content.
    """
    row = connection.execute(select(_KEYS).where(_KEYS.c.scope == scope, _KEYS.c.key == key)).first()
    if row is None:
        return None
    if row.request_digest != request_digest:
        raise ConflictError(
            f"Idempotency-Key {key!r} was used for a different request: send a new key with new content"
        )
    return StoredResponse(row.status, row.response)


def answered(connection: Connection, scope: str, key: str) -> StoredResponse | None:
    """What any request with the key was answered with, or None if there was none."""
    row = connection.execute(select(_KEYS).where(_KEYS.c.scope == scope, _KEYS.c.key == key)).first()
    return None if row is None else StoredResponse(row.status, row.response)


def forget(connection: Connection, scope: str, key: str) -> None:
    """Let the key be used again: what the request did was undone since."""
    connection.execute(delete(_KEYS).where(_KEYS.c.scope == scope, _KEYS.c.key == key))


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
