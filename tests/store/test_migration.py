import shutil
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import alembic.config
import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.operations import Operations
from alembic.util import CommandError
from sqlalchemy import Integer, inspect, text

from app.store import episodes, predictions, tasks
from app.store.database import Database, alembic_config, migrate, migration_transaction
from app.store.errors import CorruptDataError, SchemaVersionError, StoreUnavailableError
from app.store.store import Store
from app.store.tables import metadata

from .drafts import TASK, episode_draft, predict, prediction_draft, read, upload


@pytest.fixture
def database(tmp_path):
    opened = Database(f"sqlite:///{tmp_path / 'roboprompt.db'}")
    yield opened
    opened.close()


@pytest.fixture(params=["sqlite", "postgres"])
def empty_url(request, tmp_path):
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'roboprompt.db'}"
    return request.getfixturevalue("postgres").empty()


@pytest.fixture
def either(empty_url):
    """A database without tables on either server."""
    opened = Database(empty_url)
    yield opened
    opened.close()


def assert_tables_are_those_of_the_code(database):
    with database.read() as connection:
        assert compare_metadata(MigrationContext.configure(connection), metadata) == []


def tables_in(database):
    with database.read() as connection:
        return set(inspect(connection).get_table_names())


def test_migrations_and_tables_say_the_same(either):
    migrate(either)
    assert_tables_are_those_of_the_code(either)


def test_down_and_up_again(either):
    migrate(either)
    everything = tables_in(either)
    assert {"tasks", "episodes", "predictions", "api_keys"} < everything
    config = alembic_config()
    with migration_transaction(either) as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, "base")
    assert tables_in(either) == {"alembic_version"}
    migrate(either)
    assert tables_in(either) == everything


NEXT_REVISION = """
import sqlalchemy as sa
from alembic import op

revision, down_revision = "0002", "2.0"


def upgrade() -> None:
    op.add_column("tasks", sa.Column("note", sa.Text()))
    with op.batch_alter_table("episodes") as table:
        table.alter_column("instruction", type_=sa.Text(), existing_nullable=False)


def downgrade() -> None:
    with op.batch_alter_table("episodes") as table:
        table.alter_column("instruction", type_=sa.String(500), existing_nullable=False)
    op.drop_column("tasks", "note")
"""


@pytest.fixture
def next_release(tmp_path):
    """A copy of `migrations/` with one revision more."""
    copied = tmp_path / "migrations"
    shutil.copytree(Path(str(alembic_config().config_file_name)).parent, copied)
    (copied / "versions" / "0002_next.py").write_text(NEXT_REVISION)
    return copied


def test_a_filled_database_is_upgraded_by_the_next_revision_and_back(tmp_path, either, next_release, monkeypatch):
    store = Store.open(tmp_path / "data", either.engine.url.render_as_string(hide_password=False))
    episode, prediction = upload(store, episode_draft()), predict(store, prediction_draft())

    def columns_of_tasks():
        with either.read() as connection:
            return {column["name"] for column in inspect(connection).get_columns("tasks")}

    with monkeypatch.context() as patched:
        patched.setattr("app.store.database.alembic_config", lambda: Config(next_release / "alembic.ini"))
        migrate(either)
    assert "note" in columns_of_tasks()
    with store.read() as connection:
        assert episodes.get(connection, episode.id) == episode
        assert predictions.get(connection, prediction.id) == prediction
    with pytest.raises(SchemaVersionError, match="at revision 0002, which RoboPrompt"):
        migrate(either)
    with migration_transaction(either) as connection:
        config = Config(next_release / "alembic.ini")
        config.attributes["connection"] = connection
        command.downgrade(config, "2.0")
    assert_tables_are_those_of_the_code(either)
    assert read(store, episodes.get, episode.id) == episode
    store.close()


def test_database_of_another_program_is_refused(either):
    with either.write() as connection:
        connection.execute(text("CREATE TABLE tasks (title TEXT)"))
    with pytest.raises(SchemaVersionError, match=r"has tables \(tasks\) and no revision"):
        migrate(either)
    assert tables_in(either) == {"tasks"}


def test_migration_that_fails_leaves_nothing(either):
    def fail_half_way():
        with migration_transaction(either) as connection:
            connection.execute(text("CREATE TABLE half (a INTEGER)"))
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        fail_half_way()
    assert tables_in(either) == set()


def test_altering_a_table_keeps_the_rows_that_refer_to_it(tmp_path, database):
    store = Store.open(tmp_path)
    episode = upload(store, episode_draft())
    with migration_transaction(database) as connection:
        operations = Operations(MigrationContext.configure(connection))
        with operations.batch_alter_table("tasks", recreate="always") as batch:
            batch.alter_column("version", type_=Integer(), nullable=False, server_default="1")
    with store.read() as connection:
        assert episodes.get(connection, episode.id) == episode
        assert tasks.get(connection, TASK).version == 2
        assert connection.exec_driver_sql("PRAGMA foreign_keys").scalar() == 1
    store.close()


def test_migration_that_breaks_references_is_undone(tmp_path, database):
    store = Store.open(tmp_path)
    upload(store, episode_draft())
    broken = pytest.raises(CorruptDataError, match="row 1 of episodes refers to no tasks")
    with broken, migration_transaction(database) as connection:
        connection.execute(text("DELETE FROM tasks"))
    assert read(store, tasks.get, TASK).name == TASK
    store.close()


# The children wait at the pipe until the parent closes it; its exit status says how many failed.
STARTERS = """
import os, sys
from pathlib import Path
from app.store.store import Store
gate, opener = os.pipe()
children = []
for _ in range(8):
    child = os.fork()
    if child == 0:
        os.close(opener)
        os.read(gate, 1)
        Store.open(Path(sys.argv[1]), sys.argv[2]).close()
        os._exit(0)
    children.append(child)
os.close(opener)
sys.exit(sum(os.waitpid(child, 0)[1] != 0 for child in children))
"""


def test_several_processes_start_at_once(tmp_path, empty_url):
    command = [sys.executable, "-c", STARTERS, str(tmp_path / "data"), empty_url]
    finished = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False)
    assert (finished.returncode, finished.stderr) == (0, "")


def test_start_of_an_up_to_date_database_does_not_wait_for_writers(database):
    migrate(database)
    writing = sqlite3.connect(str(database.engine.url.database), isolation_level=None)
    writing.execute("BEGIN IMMEDIATE")
    impatient = Database(str(database.engine.url), busy_timeout_s=0.0)
    migrate(impatient)
    impatient.close()
    writing.close()


@pytest.fixture
def other_writer(tmp_path):
    """Another process with the lock of a file not yet in WAL mode: there SQLite fails at once, it does not wait."""
    connection = sqlite3.connect(tmp_path / "roboprompt.db", isolation_level=None, check_same_thread=False)
    connection.execute("CREATE TABLE alembic_version (version_num VARCHAR(32) NOT NULL)")
    connection.execute("BEGIN IMMEDIATE")
    yield connection
    connection.close()


def test_waits_for_another_writer_to_switch_to_wal(database, other_writer):
    threading.Timer(0.2, other_writer.rollback).start()
    migrate(database)
    assert "episodes" in tables_in(database)


@pytest.mark.usefixtures("other_writer")
def test_gives_up_waiting_for_another_writer(database):
    impatient = Database(str(database.engine.url), busy_timeout_s=0.1)
    with pytest.raises(StoreUnavailableError, match="cannot switch the database to WAL: database is locked"):
        migrate(impatient)
    impatient.close()


def run_alembic(*arguments):
    ini = str(alembic_config().config_file_name)
    alembic.config.main(argv=["--raiseerr", "-c", ini, *arguments], prog="alembic")


def test_command_line(database):
    url = f"url={database.engine.url}"
    run_alembic("-x", url, "upgrade", "head")
    assert "episodes" in tables_in(database)
    run_alembic("-x", url, "check")
    migrate(database)
    run_alembic("-x", url, "downgrade", "base")
    assert tables_in(database) == {"alembic_version"}


def test_command_line_prints_sql_for_postgresql(capsys):
    run_alembic("-x", "url=postgresql://host/name", "upgrade", "head", "--sql")
    sql = capsys.readouterr().out
    assert "sequence BIGSERIAL NOT NULL" in sql
    assert "created_at TIMESTAMP WITH TIME ZONE NOT NULL" in sql


def test_command_line_wants_to_know_which_database(monkeypatch, database):
    monkeypatch.delenv("ROBOPROMPT_DATABASE_URL", raising=False)
    with pytest.raises(CommandError, match=r"which database\? pass -x url="):
        run_alembic("current")
    monkeypatch.setenv("ROBOPROMPT_DATABASE_URL", str(database.engine.url))
    run_alembic("upgrade", "head")
    assert "tasks" in tables_in(database)
