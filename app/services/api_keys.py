"""API keys: creation, recognition, and the browser sessions that begin with one.

A key is 256 random bits, which cannot be guessed, and SHA-256 of it is as good as any slow hash: those are for
passwords, which people choose. A browser that has logged in has a token of its own, which ends on the server when it
logs out.
"""

import asyncio
import hashlib
import hmac
import logging
import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import anyio.to_thread

from app.services.errors import ExpiredKeyError
from app.store import api_keys
from app.store.api_keys import ApiKeyRecord
from app.store.errors import StoreError
from app.store.store import Store
from app.store.visibility import Visibility
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_name

SCOPES = ("read", "upload", "predict", "admin")
PREFIX = "rp"
SESSION_PREFIX = "rps"
SECRET_BYTES = 32
KNOWN_FOR_S = 5.0  # a revoked key is refused no later than this, by every worker
USE_NOTED_EVERY = timedelta(minutes=1)  # of one key; a write costs a sync of the disk
_NOBODY = "0" * 64
logger = logging.getLogger(__name__)
LONGEST = timedelta(days=7)


@dataclass(frozen=True)
class Caller:
    """The sender of a request.

    Attributes:
        scopes: what the caller may do; `admin` includes the others.
        visibility: what the caller may see.
    """

    key_id: str
    name: str
    scopes: frozenset[str]
    visibility: Visibility

    def may(self, accepted: frozenset[str]) -> bool:
        return "admin" in self.scopes or not accepted.isdisjoint(self.scopes)


class KeyRing:
    """Recognizes keys without a database read per request, and notes when they are used. For one event loop."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._records: Mapping[str, ApiKeyRecord] = {}
        self._read_at_s = -float("inf")
        self._reading = asyncio.Lock()
        self._noted_at_s: dict[str, float] = {}
        self._noting: set[asyncio.Task[None]] = set()

    async def recognize(self, token: str) -> Caller | None:
        """Return the owner of a key; None if there is no such key or it was revoked.

        Raises:
            ExpiredKeyError: if it has expired.
            StoreUnavailableError: if the keys cannot be read: then no request is let in.
        """
        records = await self._current()
        _, _, rest = token.partition("_")
        record = records.get(rest.partition("_")[0])
        expected = _NOBODY if record is None else record.digest
        if not hmac.compare_digest(digest_of(token), expected) or record is None:
            return None
        return self._admitted(record)

    async def has(self, key_id: str) -> bool:
        """Whether there is a key of this id that was not revoked."""
        return key_id in await self._current()

    async def caller_of(self, key_id: str) -> Caller | None:
        """Return the owner of the key with this id, for requests that a session has authenticated.

        Raises:
            as `recognize`.
        """
        record = (await self._current()).get(key_id)
        return None if record is None else self._admitted(record)

    async def aclose(self) -> None:
        await asyncio.gather(*self._noting)

    def _admitted(self, record: ApiKeyRecord) -> Caller:
        if record.expires_at is not None and record.expires_at <= datetime.now(UTC):
            raise ExpiredKeyError(record.name, record.expires_at)
        self._note_use(record.id)
        return caller_from(record)

    def _note_use(self, key_id: str) -> None:
        """Store the time of use in the background, at most once a minute: no request waits for it."""
        now_s = time.monotonic()
        if now_s - self._noted_at_s.get(key_id, -float("inf")) >= USE_NOTED_EVERY.total_seconds():
            self._noted_at_s[key_id] = now_s
            writing = asyncio.create_task(self._write_use(key_id))
            self._noting.add(writing)
            writing.add_done_callback(self._noting.discard)

    async def _write_use(self, key_id: str) -> None:
        try:
            await anyio.to_thread.run_sync(_write, self._store, api_keys.note_use, key_id, USE_NOTED_EVERY)
        except StoreError as error:
            logger.warning("when a key was used could not be written down: %s", error)

    async def _current(self) -> Mapping[str, ApiKeyRecord]:
        async with self._reading:
            if (now_s := time.monotonic()) - self._read_at_s > KNOWN_FOR_S:
                self._records = await anyio.to_thread.run_sync(self._read)
                self._read_at_s = now_s
        return self._records

    def _read(self) -> Mapping[str, ApiKeyRecord]:
        with self._store.read() as connection:
            return {record.id: record for record in api_keys.valid(connection)}


def _write(store: Store, query: Callable[..., None], *arguments: object) -> None:
    """Run a query of the store in a transaction of its own. Synchronous."""
    with store.write() as connection:
        query(connection, *arguments)


def caller_from(record: ApiKeyRecord) -> Caller:
    """The caller that has this key. What a scope lets see is decided here, and only here."""
    scopes = frozenset(record.scopes)
    admin = "admin" in scopes
    reads = admin or "read" in scopes
    actor = f"{record.name} ({record.id})"
    visibility = Visibility(record.id, record.tasks, reads=reads, judges_others=admin, actor=actor)
    return Caller(record.id, record.name, scopes, visibility)


def create_key(
    store: Store,
    name: str,
    scopes: Sequence[str],
    tasks: Sequence[str] | None = None,
    expires_at: datetime | None = None,
) -> str:
    """Make a key and store its digest; returns the key, which cannot be read again. Synchronous.

    Args:
        tasks: the only ones that the key is for, which need not exist yet; None or empty: any.
        expires_at: from then on the key is refused; aware.

    Raises:
        InvalidInputError: for an invalid name, no or unknown scopes, or an end that has passed.
    """
    checked_name("name", name)
    if not scopes or not set(scopes) <= set(SCOPES):
        raise InvalidInputError("scopes", f"is {', '.join(scopes) or 'empty'}", ", ".join(SCOPES))
    for task in tasks or ():
        checked_name("task", task)
    now = datetime.now(UTC)
    if expires_at is not None and expires_at <= now:
        raise InvalidInputError("expires", f"is {expires_at:%Y-%m-%d %H:%M} UTC, which has passed", "a later time")
    key_id = secrets.token_hex(6)
    token = f"{PREFIX}_{key_id}_{secrets.token_urlsafe(SECRET_BYTES)}"
    chosen = tuple(scope for scope in SCOPES if scope in scopes)
    only = tuple(dict.fromkeys(tasks)) if tasks else None
    record = ApiKeyRecord(key_id, name, digest_of(token), chosen, now, tasks=only, expires_at=expires_at)
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


class Sessions:
    """Begins, recognizes and ends sessions. Every worker reads the same database: what has ended has ended for all."""

    def __init__(self, store: Store, keys: KeyRing) -> None:
        self._store = store
        self._keys = keys

    async def begin(self, caller: Caller) -> str:
        """A new session of this caller's key: the token for its cookie; raises StoreError if it cannot be stored."""
        token = f"{SESSION_PREFIX}_{caller.key_id}_{secrets.token_urlsafe(SECRET_BYTES)}"
        until = datetime.now(UTC) + LONGEST
        await anyio.to_thread.run_sync(
            _write, self._store, api_keys.begin_session, digest_of(token), caller.key_id, until
        )
        return token

    async def recognize(self, token: str) -> Caller | None:
        """Return the owner of a session; None if there is none, it has ended, or its key was revoked.

        The database is asked only about tokens that name a valid key, so that junk costs nothing.

        Raises:
            ExpiredKeyError: if its key has expired.
            StoreUnavailableError: if sessions cannot be read.
        """
        prefix, _, rest = token.partition("_")
        key_id = rest.partition("_")[0]
        if prefix != SESSION_PREFIX or not await self._keys.has(key_id):
            return None

        def read() -> str | None:
            with self._store.read() as connection:
                return api_keys.key_of_session(connection, digest_of(token))

        return await self._keys.caller_of(key_id) if await anyio.to_thread.run_sync(read) == key_id else None

    async def end(self, token: str) -> None:
        """End the session, if it is one; raises StoreError if that cannot be stored."""
        await anyio.to_thread.run_sync(_write, self._store, api_keys.end_session, digest_of(token))
