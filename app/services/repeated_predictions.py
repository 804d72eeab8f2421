"""A prediction that is asked for again with the same `Idempotency-Key` is answered as the first was."""

import anyio.to_thread

from app.store import idempotency
from app.store.records import StoredResponse
from app.store.store import Store
from app.store.values import JsonObject

SCOPE = idempotency.PREDICT


class RepeatedPredictions:
    """Remembers answers by key. Those to requests that failed are not remembered: asking again asks the LLM again."""

    def __init__(self, store: Store) -> None:
        self._store = store

    async def answer_to(self, key: str, digest: str) -> JsonObject | None:
        """What the same request was answered with, or None if it is new.

        Args:
            digest: of the request's content.

        Raises:
            ConflictError: if the key came with other content.
        """

        def find() -> StoredResponse | None:
            with self._store.read() as connection:
                return idempotency.find(connection, SCOPE, key, digest)

        stored = await anyio.to_thread.run_sync(find)
        return None if stored is None else stored.response

    async def remember(self, key: str, digest: str, answer: JsonObject) -> JsonObject:
        """Remember the answer; of two requests that were under way at once, both get the first one's.

        Raises:
            ConflictError: if the key came with other content meanwhile.
        """

        def save() -> JsonObject:
            with self._store.write() as connection:
                if (stored := idempotency.find(connection, SCOPE, key, digest)) is not None:
                    return stored.response
                idempotency.save(connection, SCOPE, key, digest, StoredResponse(200, answer))
            return answer

        return await anyio.to_thread.run_sync(save)
