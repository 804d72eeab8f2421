import sqlite3
import subprocess
import sys

import pytest
from sqlalchemy import func, insert, select

from app.store import tables, tasks
from app.store.database import Database, migrate
from app.store.errors import CorruptDataError, StoreUnavailableError
from app.store.store import Store

from .drafts import episode_draft, read, upload, write


@pytest.fixture
def database(tmp_path):
    opened = Database(f"sqlite:///{tmp_path / 'a.db'}", busy_timeout_s=0.1)
    migrate(opened)
    yield opened
    opened.close()


@pytest.mark.parametrize("kind", ["read", "write"])
@pytest.mark.parametrize(
    ("pragma", "value"), [("journal_mode", "wal"), ("synchronous", 2), ("foreign_keys", 1), ("busy_timeout", 10_000)]
)
def test_every_connection_is_durable_and_strict(sqlite_store, kind, pragma, value):
    with getattr(sqlite_store, kind)() as connection:
        assert connection.exec_driver_sql(f"PRAGMA {pragma}").scalar() == value


def test_exception_rolls_back(store):
    def fail_after_writing():
        with store.write() as connection:
            tasks.get_or_create(connection, "a", {})
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        fail_after_writing()
    assert read(store, tasks.list_all) == ()


def test_reader_sees_one_state_and_does_not_wait_for_a_writer(database):
    with database.read() as reader:
        assert tasks.list_all(reader) == ()
        with database.write() as writer:
            tasks.get_or_create(writer, "a", {})
        assert tasks.list_all(reader) == ()
    with database.read() as reader:
        assert [task.name for task in tasks.list_all(reader)] == ["a"]


def test_writer_of_another_process_locks_us_out(database):
    other = sqlite3.connect(database.engine.url.database, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(StoreUnavailableError, match="locked"), database.write():
        pass
    other.close()
    with database.write():
        pass


def test_writer_of_this_process_that_takes_too_long(database):
    busy = pytest.raises(StoreUnavailableError, match=r"busy with other writers for 0\.1 s")
    with database.write(), busy, database.write():
        pass
    with database.write():
        pass


def test_a_full_disk_is_reported_without_its_path(database, caplog):
    with database.write() as connection:
        connection.exec_driver_sql("PRAGMA max_page_count=1")  # of this connection, which the next write takes again
    expected = r"^database: database or disk is full: free space on the service's disk, then send the request again$"
    with pytest.raises(StoreUnavailableError, match=expected), database.write() as connection:
        tasks.get_or_create(connection, "a", {"note": "x" * 1_000_000})
    assert str(database.engine.url.database) in caplog.text
    assert read(database, tasks.list_all) == ()


def test_read_only_database(database):
    with database.write() as connection:
        connection.exec_driver_sql("PRAGMA query_only=ON")  # of this connection, which the next write takes again
    with pytest.raises(StoreUnavailableError, match="readonly"), database.write() as connection:
        tasks.get_or_create(connection, "a", {})


def test_broken_rule_of_the_schema_is_not_hidden(database):
    with pytest.raises(Exception, match="NOT NULL") as caught, database.write() as connection:
        connection.execute(insert(tables.api_keys).values(id="a"))
    assert not isinstance(caught.value, StoreUnavailableError | CorruptDataError)


def test_file_that_is_no_database(tmp_path):
    (tmp_path / "roboprompt.db").write_text("not a database " * 100)
    with pytest.raises(CorruptDataError, match=r"roboprompt\.db"):
        Store.open(tmp_path)


def test_damaged_page(tmp_path):
    store = Store.open(tmp_path)
    for seed in range(20):
        upload(store, episode_draft(seed))
    store.close()
    path = tmp_path / "roboprompt.db"
    contents = path.read_bytes()
    path.write_bytes(contents[:4096] + b"\xff" * (len(contents) - 4096))
    database = Database(f"sqlite:///{path}")
    with pytest.raises(CorruptDataError, match="malformed"), database.read() as connection:
        connection.scalar(select(func.sum(tables.episodes.c.num_frames)))
    database.close()


def test_database_in_memory_is_refused(tmp_path):
    with pytest.raises(StoreUnavailableError, match="journal mode 'memory'"):
        Store.open(tmp_path, "sqlite://")


def test_data_directory_that_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StoreUnavailableError, match="data directory"):
        Store.open(tmp_path / "file" / "data")


LOOK = "import sqlite3, sys; print(*sqlite3.connect(sys.argv[1]).execute('SELECT name FROM tasks').fetchall())"


def test_a_further_connection_keeps_the_locks(database):
    """Without them another process that ends deletes the log, and what is written after that is lost."""

    def seen_by_another_process():
        path = str(database.engine.url.database)
        return subprocess.run([sys.executable, "-c", LOOK, path], check=True, capture_output=True, text=True).stdout

    with database.read(), database.read():  # the second makes a connection beside the first
        write(database, tasks.get_or_create, "a", {})
    assert "a" in seen_by_another_process()
    write(database, tasks.get_or_create, "b", {})
    assert "b" in seen_by_another_process()
