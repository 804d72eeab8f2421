"""Each row of `roboprompt doctor`, with what it looks at broken."""

import sqlite3
from contextlib import closing

import pytest
from typer.testing import CliRunner

from app.cli import application, doctor
from app.cli.shared import packages_of_extras
from app.settings import Settings
from app.store.store import Store


@pytest.fixture
def look(tmp_path, monkeypatch):
    """Runs the command in an empty folder, on a free port; what takes seconds is looked at by tests of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("app.cli.doctor.opengl", lambda: doctor.Probe("OpenGL", "ok", "", required=False))

    def run(**environment):
        variables = {"ROBOPROMPT_DEFAULT_MODEL": "nearest", **environment}
        return CliRunner(env={"COLUMNS": "300"}).invoke(application, ["doctor"], env=variables)

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


def test_opengl_that_is_switched_off(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    row = doctor.opengl()
    assert (row.state, row.required) == ("missing", False)
    assert "libegl1" in row.remedy
