"""Each row of `roboprompt doctor`, with what it looks at broken."""

import shutil
import socket
import sqlite3
from collections import namedtuple
from contextlib import closing

import pytest
from typer.testing import CliRunner

from app.cli import application, doctor
from app.cli.shared import packages_of_extras
from app.settings import Settings
from app.store.store import Store
from tests.e2e.processes import answering

GIGABYTES = 10**6  # in kB


@pytest.fixture
def look(tmp_path, monkeypatch):
    """Runs the command in an empty folder, on a free port; what takes seconds is looked at by tests of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("app.cli.doctor.opengl", lambda: doctor.Probe("OpenGL", "ok", "", required=False))

    def run(**environment):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = str(free.getsockname()[1])
        variables = {"ROBOPROMPT_DEFAULT_MODEL": "nearest", **environment}
        return CliRunner(env={"COLUMNS": "300"}).invoke(application, ["doctor", "--port", port], env=variables)

    return run


def test_a_machine_where_nothing_needed_is_missing(look, tmp_path):
    run = look()
    assert run.exit_code == 0, run.output
    assert "will be made" in run.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        ("ROBOPROMPT_MAX_BODY_MB", "0", "greater than 0"),
        ("ROBOPROMPT_DEFAULT_MODEL", "openai/gpt", "set ROBOPROMPT_OPENAI_API_KEY"),
        ("ROBOPROMPT_DEFAULT_MODEL", "embedded//nowhere.gguf", "is not a GGUF file"),
        ("ROBOPROMPT_DATABASE_URL", "nonsense", "Could not parse"),
        ("ROBOPROMPT_DATA", "/proc/roboprompt", "--data FOLDER"),
    ],
)
def test_status_is_1_where_something_needed_fails(look, variable, value, said):
    run = look(**{variable: value})
    assert run.exit_code == 1
    assert said in run.output
    assert "missing or wrong" in run.output


def test_a_misspelled_setting_is_named_with_the_right_one(look):
    run = look(ROBOPROMPT_DEFAULT_MODLE="x")
    assert run.exit_code == 0
    assert "did you mean ROBOPROMPT_DEFAULT_MODEL?" in run.output


def in_folder(tmp_path):
    return Settings(data=tmp_path)


def test_database(tmp_path):
    Store.open(tmp_path).close()
    assert doctor.database(in_folder(tmp_path)).state == "ok"
    with closing(sqlite3.connect(tmp_path / "roboprompt.db")) as database, database:
        database.execute("ALTER TABLE labels DROP COLUMN yaw_deg")
    row = doctor.database(in_folder(tmp_path))
    assert (row.state, "1 differences" in row.seen) == ("wrong", True)
    with closing(sqlite3.connect(tmp_path / "roboprompt.db")) as database, database:
        database.execute("UPDATE alembic_version SET version_num = '9999'")
    assert "at revision 9999" in doctor.database(in_folder(tmp_path)).seen


def test_damaged_database(tmp_path):
    (tmp_path / "roboprompt.db").write_bytes(b"no database" * 1000)
    assert doctor.database(in_folder(tmp_path)).state == "wrong"


def test_data_folder_that_is_a_file_or_of_everybody(tmp_path):
    (tmp_path / "file").touch()
    assert doctor.data_folder(tmp_path / "file").state == "wrong"
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared").chmod(0o1777)
    assert "open to others" in doctor.data_folder(tmp_path / "shared").seen


def test_full_disk(tmp_path, monkeypatch):
    usage = namedtuple("Usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**12, 10**12 - 10**8, 10**8))
    row = doctor.disk(tmp_path / "not" / "there")
    assert (row.state, row.seen) == ("wrong", "0.1 GB free")


@pytest.mark.parametrize(
    ("code", "remedy"),
    [
        ("raise ImportError('libgomp.so.1: cannot open shared object file')", "apt-get install libgomp1"),
        ("import os; os.kill(os.getpid(), 4)", "pip install --force-reinstall xllamacpp"),
    ],
)
def test_llama_cpp_that_does_not_load(code, remedy):
    row = doctor.library(code)
    assert (row.state, row.remedy) == ("wrong", remedy)


def test_extra_that_the_settings_need(monkeypatch):
    assert {"sim", "postgres", "s3"} <= set(packages_of_extras())
    monkeypatch.setattr(doctor, "is_installed", lambda package: package != "obstore")
    for settings, required in ((Settings(), False), (Settings(blobs_url="s3://bucket"), True)):
        (row,) = (row for row in doctor.extras(settings) if row.state != "ok")
        assert (row.name, row.required, row.remedy) == ("extra s3", required, "pip install 'roboprompt[s3]'")


@pytest.mark.parametrize(
    ("available_kb", "limit", "state"),
    [(8 * GIGABYTES, "max", "ok"), (GIGABYTES // 2, "max", "wrong"), (8 * GIGABYTES, "500000000", "wrong")],
)
def test_memory(tmp_path, available_kb, limit, state):
    (tmp_path / "meminfo").write_text(f"MemTotal: 16000000 kB\nMemAvailable:    {available_kb} kB\n")
    (tmp_path / "limit").write_text(limit)
    assert doctor.memory(tmp_path / "meminfo", tmp_path / "limit").state == state


@pytest.mark.parametrize(("answer", "state"), [((200, b'{"status": "ok", "checks": {}}'), "ok"), ((501, b""), "wrong")])
def test_port_of_a_service_and_of_another_program(answer, state):
    status, content = answer
    with answering(lambda *_: (status, "application/json", content)) as url:
        assert doctor.listening(int(url.rpartition(":")[2])).state == state


def test_opengl_that_is_switched_off(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    row = doctor.opengl()
    assert (row.state, row.required) == ("missing", False)
    assert "libegl1" in row.remedy
