import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest

from app.store import episodes, idempotency, tasks
from app.store.errors import ConflictError

from .drafts import SETTINGS, TASK, episode_draft, read, write

SCOPE = "POST /episodes"


def test_same_request_gets_the_stored_answer(store):
    answer = {"id": "e1", "keyframes": [1, 2.5, None]}
    with store.write() as connection:
        assert idempotency.find(connection, SCOPE, "key", "digest") is None
        idempotency.save(connection, SCOPE, "key", "digest", answer)
    with store.read() as connection:
        assert idempotency.find(connection, SCOPE, "key", "digest") == answer
        assert idempotency.find(connection, "POST /predict", "key", "digest") is None
        assert idempotency.find(connection, SCOPE, "other key", "digest") is None


def test_same_key_for_another_request_is_a_conflict(store):
    with store.write() as connection:
        idempotency.save(connection, SCOPE, "key", "digest", {})
        with pytest.raises(ConflictError, match="Idempotency-Key 'key' was used for a different request"):
            idempotency.find(connection, SCOPE, "key", "other digest")


def test_request_repeated_at_the_same_time_is_done_once(store):
    start = threading.Barrier(4)

    def upload_once(_):
        start.wait()
        with store.write() as connection:
            if found := idempotency.find(connection, SCOPE, "key", "digest"):
                return found
            tasks.get_or_create(connection, TASK, SETTINGS)
            answer = {"id": episodes.add(connection, episode_draft()).id}
            idempotency.save(connection, SCOPE, "key", "digest", answer)
            return answer

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(upload_once, range(4)))
    (episode,) = read(store, episodes.list_page).items
    assert answers == [{"id": episode.id}] * 4


def test_a_key_is_forgotten_after_a_day(store, monkeypatch):
    write(store, idempotency.save, SCOPE, "key", "digest", {"id": "old"})
    monkeypatch.setitem(idempotency.KEPT_FOR, SCOPE, timedelta(0))
    with store.write() as connection:
        assert idempotency.find(connection, SCOPE, "key", "other digest") is None
        idempotency.save(connection, SCOPE, "key", "other digest", {"id": "new"})
    monkeypatch.undo()
    assert read(store, idempotency.find, SCOPE, "key", "other digest") == {"id": "new"}
