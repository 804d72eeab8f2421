import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest

from app.store import episodes, idempotency, tasks
from app.store.errors import ConflictError
from app.store.records import StoredResponse
from app.store.store import Store

from .drafts import SETTINGS, TASK, episode_draft

SCOPE = "POST /episodes"


def test_same_request_gets_the_stored_answer(store: Store) -> None:
    answer = StoredResponse(201, {"id": "e1", "keyframes": [1, 2.5, None]})
    with store.write() as connection:
        assert idempotency.find(connection, SCOPE, "key", "digest") is None
        idempotency.save(connection, SCOPE, "key", "digest", answer)
    with store.read() as connection:
        assert idempotency.find(connection, SCOPE, "key", "digest") == answer
        assert idempotency.find(connection, "POST /predict", "key", "digest") is None
        assert idempotency.find(connection, SCOPE, "other key", "digest") is None


def test_same_key_for_another_request_is_a_conflict(store: Store) -> None:
    with store.write() as connection:
        idempotency.save(connection, SCOPE, "key", "digest", StoredResponse(201, {}))
        with pytest.raises(ConflictError, match="Idempotency-Key 'key' was used for a different request"):
            idempotency.find(connection, SCOPE, "key", "other digest")


def test_request_that_failed_leaves_no_key(store: Store) -> None:
    def fail_after_saving() -> None:
        with store.write() as connection:
            idempotency.save(connection, SCOPE, "key", "digest", StoredResponse(201, {}))
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        fail_after_saving()
    with store.read() as connection:
        assert idempotency.find(connection, SCOPE, "key", "digest") is None


def test_request_repeated_at_the_same_time_is_done_once(store: Store) -> None:
    start = threading.Barrier(4)

    def upload_once(_: int) -> StoredResponse:
        start.wait()
        with store.write() as connection:
            if found := idempotency.find(connection, SCOPE, "key", "digest"):
                return found
            tasks.get_or_create(connection, TASK, SETTINGS)
            answer = StoredResponse(201, {"id": episodes.add(connection, episode_draft()).id})
            idempotency.save(connection, SCOPE, "key", "digest", answer)
            return answer

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(upload_once, range(4)))
    with store.read() as connection:
        (episode,) = episodes.list_page(connection).items
    assert answers == [StoredResponse(201, {"id": episode.id})] * 4


def test_a_key_is_forgotten_after_a_day(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    with store.write() as connection:
        idempotency.save(connection, SCOPE, "key", "digest", StoredResponse(201, {"id": "old"}))
    monkeypatch.setitem(idempotency.KEPT_FOR, SCOPE, timedelta(0))
    with store.write() as connection:
        assert idempotency.find(connection, SCOPE, "key", "other digest") is None
        idempotency.save(connection, SCOPE, "key", "other digest", StoredResponse(201, {"id": "new"}))
    monkeypatch.undo()
    with store.read() as connection:
        assert idempotency.find(connection, SCOPE, "key", "other digest") == StoredResponse(201, {"id": "new"})
