"""What is special to PostgreSQL: durable commits, locks that end, NUL, errors."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import exc, text

from app.store import episodes, predictions, tasks
from app.store.database import Database, lock
from app.store.errors import ConflictError, NotFoundError, StoreUnavailableError
from app.store.store import Store
from tests.postgres import PostgresServer

from .drafts import SETTINGS, TASK, episode_draft, predict, prediction_draft, upload


@pytest.fixture
def store(tmp_path: Path, postgres: PostgresServer) -> Iterator[Store]:
    opened = Store.open(tmp_path, postgres.migrated())
    yield opened
    opened.close()


@pytest.fixture
def impatient(postgres: PostgresServer) -> Iterator[Database]:
    opened = Database(postgres.migrated(), busy_timeout_s=0.1, server_connections=3)
    yield opened
    opened.close()


def test_commits_are_durable_and_readers_see_one_state(store: Store) -> None:
    with store.write() as connection:
        assert connection.scalar(text("SHOW synchronous_commit")) == "on"
        assert connection.scalar(text("SHOW transaction_isolation")) == "read committed"
    with store.read() as reader:
        assert reader.scalar(text("SHOW transaction_read_only")) == "on"
        assert tasks.list_all(reader) == ()
        upload(store, episode_draft())
        assert tasks.list_all(reader) == ()


def test_nul_in_a_text_is_replaced_and_never_found(store: Store) -> None:
    added = predict(store, prediction_draft(reply_text="a\0b", request={"note": "a\0b"}))
    with store.read() as connection:
        stored = predictions.get(connection, added.id)
        with pytest.raises(NotFoundError):
            episodes.get(connection, "a\0")
    assert (stored.reply_text, stored.request) == ("a\N{REPLACEMENT CHARACTER}b", {"note": "a\0b"})


def test_writer_that_waits_too_long_for_a_lock(impatient: Database) -> None:
    with impatient.write() as connection:
        tasks.get_or_create(connection, TASK, SETTINGS)
    with impatient.write() as first:
        tasks.lock(first, TASK)
        with pytest.raises(StoreUnavailableError, match="lock timeout"), impatient.write() as second:
            tasks.lock(second, TASK)
    with impatient.write() as connection:
        assert tasks.lock(connection, TASK).name == TASK


def test_named_locks_end_with_their_transaction(impatient: Database) -> None:
    with impatient.write() as first, impatient.write() as second:
        lock(first, "POST /episodes a")
        lock(second, "POST /episodes b")
        with pytest.raises(exc.OperationalError, match="lock timeout"):
            lock(second, "POST /episodes a")
    with impatient.write() as connection:
        lock(connection, "POST /episodes a")


def test_a_prediction_does_not_wait_for_an_upload_under_way(store: Store) -> None:
    upload(store, episode_draft())
    with store.write() as uploading:
        tasks.get_or_create(uploading, TASK, SETTINGS)
        assert predict_without_creating(store) > 0


def predict_without_creating(store: Store) -> int:
    with store.write() as connection:
        return predictions.add(connection, prediction_draft()).sequence


def test_deleting_the_last_episode_while_another_is_uploaded(store: Store) -> None:
    """The task must not forget its objects' names when an episode is about to come in."""
    only = upload(store, episode_draft())
    removed = threading.Event()

    def remove() -> None:
        with store.write() as connection:
            episodes.remove(connection, only.id)
        removed.set()

    with store.write() as connection:
        tasks.get_or_create(connection, TASK, SETTINGS)
        episodes.add(connection, episode_draft(1))
        thread = threading.Thread(target=remove)
        thread.start()
        assert not removed.wait(0.2)
    thread.join()
    with store.read() as connection:
        assert tasks.get(connection, TASK).object_names == ("drawer", "cube")


def test_a_version_that_was_required_holds_until_the_commit(store: Store) -> None:
    upload(store, episode_draft())
    with store.write() as connection:
        tasks.require_version(connection, TASK, 2)
        thread = threading.Thread(target=upload, args=(store, episode_draft(1)))
        thread.start()
        thread.join(0.2)
        assert thread.is_alive()
        assert tasks.get(connection, TASK).version == 2
    thread.join()
    with pytest.raises(ConflictError), store.write() as connection:
        tasks.require_version(connection, TASK, 2)


def test_all_connections_taken(impatient: Database) -> None:
    busy = pytest.raises(StoreUnavailableError, match="all 3 connections are in use")
    with impatient.read(), impatient.read(), impatient.read(), busy, impatient.read():
        pass


def test_standby_is_unavailable_for_writing(postgres: PostgresServer) -> None:
    database = Database(postgres.migrated())
    with database.write() as connection:
        connection.execute(text("SET SESSION default_transaction_read_only = on"))
    with pytest.raises(StoreUnavailableError, match="read-only"), database.write() as connection:
        tasks.get_or_create(connection, TASK, SETTINGS)
    database.close()


def test_connections_that_the_server_closed_are_replaced(store: Store, postgres: PostgresServer) -> None:
    store.ping()
    with store.write() as connection:
        connection.execute(
            text(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = current_database() "
                "AND pid <> pg_backend_pid()"
            )
        )
    store.ping()


def test_server_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StoreUnavailableError, match="connection failed"):
        Store.open(tmp_path, "postgresql://postgres@127.0.0.1:1/none")


@pytest.mark.parametrize("url", ["mariadb://localhost/a", "oracle://localhost/a"])
def test_other_databases_are_refused(tmp_path: Path, url: str) -> None:
    with pytest.raises(StoreUnavailableError, match="database URL"):
        Store.open(tmp_path, url)
