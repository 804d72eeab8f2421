"""Who may do what: keys are made, recognised and taken back.

A key is 256 random bits, so that nobody can guess one, and SHA-256 of it is as good as any slow hash: those are for
passwords, which people choose.
"""

import asyncio
import hashlib
import hmac
import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import anyio.to_thread

from app.pipeline.errors import InvalidInputError
from app.pipeline.wording import checked_name
from app.store import api_keys, audit
from app.store.api_keys import ApiKeyRecord
from app.store.store import Store

SCOPES = ("read", "upload", "predict", "admin")
PREFIX = "rp"
SECRET_BYTES = 32
KNOWN_FOR_S = 5.0  # a revoked key is refused no later than this, by every worker
_NOBODY = "0" * 64


@dataclass(frozen=True)
class Caller:
    """Who sent a request.

    Attributes:
        scopes: what the caller may do; `admin` includes the others.
    """

    key_id: str
    name: str
    scopes: frozenset[str]

    def may(self, accepted: frozenset[str]) -> bool:
        """Whether one of the `accepted` scopes is the caller's."""
        return "admin" in self.scopes or not accepted.isdisjoint(self.scopes)


def audit_name(caller: Caller | None) -> str:
    """How the audit log names who sent a request."""
    return audit.LOCAL if caller is None else f"{caller.name} ({caller.key_id})"


class KeyRing:
    """Recognises keys without a database read per request. For one event loop.

    Args:
        known_for_s: how long what was read of the keys holds.
    """

    def __init__(self, store: Store, known_for_s: float = KNOWN_FOR_S) -> None:
        self._store = store
        self._known_for_s = known_for_s
        self._records: Mapping[str, ApiKeyRecord] = {}
        self._read_at_s = -float("inf")
        self._reading = asyncio.Lock()

    async def recognise(self, token: str) -> Caller | None:
        """Whose key it is, or None if it is nobody's, or was revoked.

        Raises:
            StoreUnavailableError: if the keys cannot be read: then nobody is let in.
        """
        records = await self._current()
        _, _, rest = token.partition("_")
        record = records.get(rest.partition("_")[0])
        expected = _NOBODY if record is None else record.digest
        if not hmac.compare_digest(digest_of(token), expected) or record is None:
            return None
        return Caller(record.id, record.name, frozenset(record.scopes))

    async def _current(self) -> Mapping[str, ApiKeyRecord]:
        if time.monotonic() - self._read_at_s > self._known_for_s:
            async with self._reading:
                if time.monotonic() - self._read_at_s > self._known_for_s:
                    started_s = time.monotonic()
                    self._records = await anyio.to_thread.run_sync(self._read)
                    self._read_at_s = started_s
        return self._records

    def _read(self) -> Mapping[str, ApiKeyRecord]:
        with self._store.read() as connection:
            return {record.id: record for record in api_keys.valid(connection)}


def create_key(store: Store, name: str, scopes: Sequence[str]) -> str:
    """Make a key and store its digest; returns the key, which nobody can read again. Synchronous.

    Raises:
        InvalidInputError: for a name that is none, and unknown or no scopes.
    """
    checked_name("name", name)
    if not scopes or not set(scopes) <= set(SCOPES):
        raise InvalidInputError("scopes", f"is {', '.join(scopes) or 'empty'}", ", ".join(SCOPES))
    key_id = secrets.token_hex(6)
    token = f"{PREFIX}_{key_id}_{secrets.token_urlsafe(SECRET_BYTES)}"
    chosen = tuple(scope for scope in SCOPES if scope in scopes)
    record = ApiKeyRecord(key_id, name, digest_of(token), chosen, datetime.now(UTC))
    with store.write() as connection:
        api_keys.add(connection, record)
    return token


def has_keys(store: Store) -> bool:
    """Whether there is a valid key. Synchronous."""
    with store.read() as connection:
        return bool(api_keys.valid(connection))


def digest_of(token: str) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(token.encode(errors="surrogatepass")).hexdigest()
