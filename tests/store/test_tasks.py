from concurrent.futures import ThreadPoolExecutor

import pytest

from app.store import predictions, tasks
from app.store.errors import NotFoundError
from app.store.records import TaskCounts

from .drafts import SETTINGS, TASK, episode_draft, predict, prediction_draft, read, upload, write


def test_new_task(store):
    created = write(store, tasks.get_or_create, TASK, SETTINGS)
    assert (created.version, created.settings, created.object_names) == (1, SETTINGS, None)
    assert created.created_at.utcoffset().total_seconds() == 0
    assert read(store, tasks.get, TASK) == created


def test_existing_task_keeps_its_settings(store):
    created = write(store, tasks.get_or_create, TASK, SETTINGS)
    assert write(store, tasks.get_or_create, TASK, {"other": 1}) == created


def test_unknown_task(store):
    with store.write() as connection:
        for query in (tasks.get, lambda connection, name: tasks.update_settings(connection, name, {})):
            with pytest.raises(NotFoundError, match="there is no task 'nope'") as caught:
                query(connection, "nope")
            assert caught.value.args == ("task", "nope")


def test_version_grows_only_when_settings_differ(store):
    with store.write() as connection:
        created = tasks.get_or_create(connection, TASK, SETTINGS)
        assert tasks.update_settings(connection, TASK, dict(SETTINGS)) == created
        changed = tasks.update_settings(connection, TASK, {**SETTINGS, "num_demonstrations": 5})
    assert (changed.version, changed.settings["num_demonstrations"]) == (2, 5)
    assert changed.updated_at > created.updated_at
    assert changed.created_at == created.created_at


def test_counts(store):
    upload(store, episode_draft())
    upload(store, episode_draft(1))
    first, second, *_ = [predict(store, prediction_draft()) for _ in range(4)]
    with store.write() as connection:
        tasks.get_or_create(connection, "empty", {})
        predictions.record_outcome(connection, first.id, True, None)
        predictions.record_outcome(connection, second.id, False, None)
        assert tasks.counts(connection) == {
            TASK: TaskCounts(episodes=2, predictions=4, successes=1, failures=1),
            "empty": TaskCounts(),
        }


def test_no_version_is_lost_under_concurrent_uploads(store):
    with ThreadPoolExecutor(8) as pool:
        stored = list(pool.map(lambda seed: upload(store, episode_draft(seed)), range(24)))
    assert len({episode.sequence for episode in stored}) == 24
    assert read(store, tasks.get, TASK).version == 25
