"""What is special to PostgreSQL: durable commits, locks that end, NUL, errors."""

import threading

import pytest
from sqlalchemy import exc, text

from app.store import episodes, predictions, tasks
from app.store.database import Database, lock
from app.store.errors import NotFoundError, StoreUnavailableError
from app.store.store import Store

from .drafts import SETTINGS, TASK, episode_draft, predict, prediction_draft, read, upload, write


@pytest.fixture
def store(tmp_path, postgres):
    opened = Store.open(tmp_path, postgres.migrated())
    yield opened
    opened.close()


@pytest.fixture
def impatient(postgres):
    opened = Database(postgres.migrated(), busy_timeout_s=0.1, server_connections=3)
    yield opened
    opened.close()


def test_commits_are_durable_and_readers_see_one_state(store):
    with store.write() as connection:
        assert connection.scalar(text("SHOW synchronous_commit")) == "on"
        assert connection.scalar(text("SHOW transaction_isolation")) == "read committed"
    with store.read() as reader:
        assert reader.scalar(text("SHOW transaction_read_only")) == "on"
        assert tasks.list_all(reader) == ()
        upload(store, episode_draft())
        assert tasks.list_all(reader) == ()


def test_nul_in_a_text_is_replaced_and_never_found(store):
    added = predict(store, prediction_draft(reply_text="a\0b", request={"note": "a\0b"}))
    with store.read() as connection:
        stored = predictions.get(connection, added.id)
        with pytest.raises(NotFoundError):
            episodes.get(connection, "a\0")
    assert (stored.reply_text, stored.request) == ("a\N{REPLACEMENT CHARACTER}b", {"note": "a\0b"})


def test_writer_that_waits_too_long_for_a_lock(impatient):
    write(impatient, tasks.get_or_create, TASK, SETTINGS)
    with impatient.write() as first:
        tasks.lock(first, TASK)
        with pytest.raises(StoreUnavailableError, match="lock timeout"), impatient.write() as second:
            tasks.lock(second, TASK)
    assert write(impatient, tasks.lock, TASK).name == TASK


def test_named_locks_end_with_their_transaction(impatient):
    with impatient.write() as first, impatient.write() as second:
        lock(first, "POST /episodes a")
        lock(second, "POST /episodes b")
        with pytest.raises(exc.OperationalError, match="lock timeout"):
            lock(second, "POST /episodes a")
    write(impatient, lock, "POST /episodes a")


def test_a_prediction_does_not_wait_for_an_upload_under_way(store):
    upload(store, episode_draft())
    with store.write() as uploading:
        tasks.get_or_create(uploading, TASK, SETTINGS)
        assert predict_without_creating(store) > 0


def predict_without_creating(store):
    return write(store, predictions.add, prediction_draft()).sequence


def test_deleting_the_last_episode_while_another_is_uploaded(store):
    """The task must not forget its objects' names when an episode is about to come in."""
    only = upload(store, episode_draft())
    removed = threading.Event()

    def remove():
        write(store, episodes.remove, only.id)
        removed.set()

    with store.write() as connection:
        tasks.get_or_create(connection, TASK, SETTINGS)
        episodes.add(connection, episode_draft(1))
        thread = threading.Thread(target=remove)
        thread.start()
        assert not removed.wait(0.2)
    thread.join()
    assert read(store, tasks.get, TASK).object_names == ("drawer", "cube")


def test_a_locked_task_stays_as_it_is_until_the_commit(store):
    upload(store, episode_draft())
    with store.write() as connection:
        assert tasks.lock(connection, TASK).version == 2
        thread = threading.Thread(target=upload, args=(store, episode_draft(1)))
        thread.start()
        thread.join(0.2)
        assert thread.is_alive()
        assert tasks.get(connection, TASK).version == 2
    thread.join()


def test_all_connections_taken(impatient):
    busy = pytest.raises(StoreUnavailableError, match="all 3 connections are in use")
    with impatient.read(), impatient.read(), impatient.read(), busy, impatient.read():
        pass


def test_standby_is_unavailable_for_writing(postgres):
    database = Database(postgres.migrated())
    with database.write() as connection:
        connection.execute(text("SET SESSION default_transaction_read_only = on"))
    with pytest.raises(StoreUnavailableError, match="read-only"), database.write() as connection:
        tasks.get_or_create(connection, TASK, SETTINGS)
    database.close()


def test_connections_that_the_server_closed_are_replaced(store, postgres):
    store.ping()
    with store.write() as connection:
        connection.execute(
            text(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = current_database() "
                "AND pid <> pg_backend_pid()"
            )
        )
    store.ping()


def test_server_that_is_not_there(tmp_path):
    with pytest.raises(StoreUnavailableError, match="connection failed"):
        Store.open(tmp_path, "postgresql://postgres@127.0.0.1:1/none")


@pytest.mark.parametrize("url", ["mariadb://localhost/a", "oracle://localhost/a"])
def test_other_databases_are_refused(tmp_path, url):
    with pytest.raises(StoreUnavailableError, match="database URL"):
        Store.open(tmp_path, url)
