"""Answers to requests that carried an `Idempotency-Key`. Each query runs on the caller's transaction.

An answer belongs to the API key that got it: another one with the same `Idempotency-Key` gets its own. Uploads to a
service without API keys have no owner: every caller who sends the same content again gets their answer.
"""

from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Connection, Row, delete, insert, select

from app.store import tables
from app.store.database import lock, writes
from app.store.errors import ConflictError
from app.store.values import JsonObject
from app.store.visibility import NO_KEY, present

UPLOAD, PREDICT = "POST /episodes", "POST /predict"  # scopes
# After this a key may be used again. An upload's is kept: a dataset imported twice adds nothing, however much later.
KEPT_FOR = {PREDICT: timedelta(hours=24)}
_KEYS = tables.idempotency_keys


def find(connection: Connection, scope: str, key: str, request_digest: str) -> JsonObject | None:
    """Return the earlier answer to the same request; None if it is new.

    In a write transaction it waits for another one that has the same key under way.

    Args:
        scope: what the key belongs to, e.g. ``POST /episodes``.
        request_digest: of the request's content: SHA-256 in hexadecimal.

    Raises:
        ConflictError: if the key came with different content.
    """
    if writes(connection):
        lock(connection, f"{scope} {present().key_id} {key}")
    row = _row(connection, scope, key, present().key_id)
    if row is None and scope == UPLOAD:
        unowned = _row(connection, scope, key, NO_KEY)
        row = unowned if unowned is not None and unowned.request_digest == request_digest else None
    if row is None or (scope in KEPT_FOR and row.created_at < datetime.now(UTC) - KEPT_FOR[scope]):
        return None
    if row.request_digest != request_digest:
        raise ConflictError(
            f"Idempotency-Key {key!r} was used for a different request: send a new key with new content"
        )
    response: JsonObject = row.response
    return response


def answered(connection: Connection, scope: str, key: str) -> JsonObject | None:
    """Return the answer to the caller's request with the key; None if there was none."""
    row = _row(connection, scope, key, present().key_id) or _row(connection, scope, key, NO_KEY)
    return None if row is None else row.response


def save(connection: Connection, scope: str, key: str, request_digest: str, answer: JsonObject) -> None:
    """Remember the answer in the place of an earlier one, and forget those of the same scope that are too old.

    Call it after `find`, in the write transaction that does what the request asks.
    """
    now, own = datetime.now(UTC), {"scope": scope, "owner": present().key_id, "key": key}
    connection.execute(delete(_KEYS).filter_by(**own))
    if scope in KEPT_FOR:
        connection.execute(delete(_KEYS).where(_KEYS.c.scope == scope, _KEYS.c.created_at < now - KEPT_FOR[scope]))
    values = {"request_digest": request_digest, "response": answer, "created_at": now}
    connection.execute(insert(_KEYS).values({**own, **values}))


def _row(connection: Connection, scope: str, key: str, owner: str) -> Row[Any] | None:
    query = select(_KEYS).where(_KEYS.c.scope == scope, _KEYS.c.owner == owner, _KEYS.c.key == key)
    return connection.execute(query).first()
