"""Browsers that have logged in with a key: each has a token of its own, which ends on the server when it logs out."""

import secrets
from datetime import UTC, datetime, timedelta

import anyio.to_thread

from app.services.api_keys import SECRET_BYTES, Caller, KeyRing, digest_of
from app.store import sessions
from app.store.store import Store

PREFIX = "rps"
LONGEST = timedelta(days=7)


class Sessions:
    """Begins, recognises and ends sessions. Every worker reads the same database: what has ended has ended for all."""

    def __init__(self, store: Store, keys: KeyRing) -> None:
        self._store = store
        self._keys = keys

    async def begin(self, caller: Caller) -> str:
        """A new session of this caller's key: the token for its cookie.

        Raises:
            StoreError: if it cannot be stored.
        """
        token = f"{PREFIX}_{caller.key_id}_{secrets.token_urlsafe(SECRET_BYTES)}"

        def write() -> None:
            with self._store.write() as connection:
                sessions.begin(connection, digest_of(token), caller.key_id, datetime.now(UTC) + LONGEST)

        await anyio.to_thread.run_sync(write)
        return token

    async def recognise(self, token: str) -> Caller | None:
        """Whose session it is, or None if it is nobody's, has ended, or its key was revoked.

        The database is asked only about tokens that name a valid key, so that junk costs nothing.

        Raises:
            ExpiredKeyError: if its key has expired.
            StoreUnavailableError: if sessions cannot be read.
        """
        prefix, _, rest = token.partition("_")
        key_id = rest.partition("_")[0]
        if prefix != PREFIX or not await self._keys.has(key_id):
            return None

        def read() -> str | None:
            with self._store.read() as connection:
                return sessions.key_of(connection, digest_of(token))

        return await self._keys.caller_of(key_id) if await anyio.to_thread.run_sync(read) == key_id else None

    async def end(self, token: str) -> None:
        """End the session, if it is one.

        Raises:
            StoreError: if that cannot be stored.
        """

        def write() -> None:
            with self._store.write() as connection:
                sessions.end(connection, digest_of(token))

        await anyio.to_thread.run_sync(write)
