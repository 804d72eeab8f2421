"""API keys: creation and recognition.

A key is 256 random bits, which cannot be guessed, and SHA-256 of it is as good as any slow hash: those are for
passwords, which people choose.
"""

import asyncio
import hashlib
import hmac
import secrets
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import anyio.to_thread

from app.store import api_keys
from app.store.api_keys import ApiKeyRecord
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_name

SCOPES = ("read", "predict", "teach", "admin")  # each includes those before it
PREFIX = "rp"
SECRET_BYTES = 32
KNOWN_FOR_S = 5.0  # a revoked key is refused no later than this, by every worker
_NOBODY = "0" * 64


@dataclass(frozen=True)
class Caller:
    """The sender of a request, by its key."""

    key_id: str
    name: str
    scope: str

    def may(self, scope: str) -> bool:
        """Whether the key has this scope, or one that includes it."""
        return SCOPES.index(self.scope) >= SCOPES.index(scope)


class KeyRing:
    """Recognizes keys without a database read per request. For one event loop."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._records: Mapping[str, ApiKeyRecord] = {}
        self._read_at_s = -float("inf")
        self._reading = asyncio.Lock()

    async def recognize(self, token: str) -> Caller | None:
        """Return the owner of a key; None if there is no such key or it was revoked.

        Raises:
            StoreUnavailableError: if the keys cannot be read: then no request is let in.
        """
        records = await self._current()
        _, _, rest = token.partition("_")
        record = records.get(rest.partition("_")[0])
        expected = _NOBODY if record is None else record.digest
        if not hmac.compare_digest(digest_of(token), expected) or record is None:
            return None
        return Caller(record.id, record.name, record.scope)

    async def _current(self) -> Mapping[str, ApiKeyRecord]:
        async with self._reading:
            if (now_s := time.monotonic()) - self._read_at_s > KNOWN_FOR_S:
                self._records = await anyio.to_thread.run_sync(self._read)
                self._read_at_s = now_s
        return self._records

    def _read(self) -> Mapping[str, ApiKeyRecord]:
        with self._store.read() as connection:
            return {record.id: record for record in api_keys.valid(connection)}


def create_key(store: Store, name: str, scope: str) -> str:
    """Make a key and store its digest; returns the key, which cannot be read again. Synchronous.

    Raises:
        InvalidInputError: for an invalid name or an unknown scope.
    """
    checked_name("name", name)
    if scope not in SCOPES:
        raise InvalidInputError("scope", f"is {scope!r:.80}", ", ".join(SCOPES))
    key_id = secrets.token_hex(6)
    token = f"{PREFIX}_{key_id}_{secrets.token_urlsafe(SECRET_BYTES)}"
    with store.write() as connection:
        api_keys.add(connection, ApiKeyRecord(key_id, name, digest_of(token), scope, datetime.now(UTC)))
    return token


def has_keys(store: Store) -> bool:
    """Whether there is a valid key. Synchronous."""
    with store.read() as connection:
        return bool(api_keys.valid(connection))


def digest_of(token: str) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(token.encode(errors="surrogatepass")).hexdigest()
