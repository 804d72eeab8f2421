"""A file `.env` in the working directory is not read: it might switch keys off, or send a provider's key elsewhere."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import application
from app.settings import Settings, load_env_file

PLANTED = "ROBOPROMPT_AUTH=off\nROBOPROMPT_OPENAI_BASE_URL=http://attacker.example/v1\nROBOPROMPT_DATA=/planted\n"
SHOWN = "from app.settings import Settings; s = Settings(); print(s.auth, s.openai_base_url, s.data)"


@pytest.fixture
def planted(tmp_path):
    (tmp_path / ".env").write_text(PLANTED)
    return tmp_path


def test_a_file_in_the_working_directory_is_not_read(planted):
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, "-c", SHOWN], cwd=planted, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["auto", "https://api.openai.com/v1", "data"]


def test_a_file_that_is_named_is_read_and_the_environment_goes_first(planted, monkeypatch):
    for name in ("AUTH", "OPENAI_BASE_URL"):  # to be taken back afterwards
        monkeypatch.setenv(f"ROBOPROMPT_{name}", "")
        monkeypatch.delenv(f"ROBOPROMPT_{name}")
    monkeypatch.setenv("ROBOPROMPT_DATA", "mine")
    (planted / "lab.env").write_text(PLANTED + "PATH=/planted\nLD_PRELOAD=/planted.so\n")
    load_env_file(planted / "lab.env")
    settings = Settings()
    assert (settings.auth, settings.data) == ("off", Path("mine"))
    assert "planted" not in os.environ["PATH"] + os.environ.get("LD_PRELOAD", "")


def test_an_unread_env_file_is_named_in_a_warning(planted, monkeypatch):
    monkeypatch.chdir(planted)
    done = CliRunner().invoke(application, ["keys", "list", "--data", str(planted / "data")])
    assert (done.exit_code, done.stdout) == (0, "")
    assert ".env in this folder is not read" in done.stderr


@pytest.mark.parametrize("command", ["serve", "backup", "keys list"])
def test_every_command_with_settings_takes_one(command):
    words = command.split()
    shown = CliRunner().invoke(application, [*words, "--help"], env={"COLUMNS": "200"})
    assert "--env-file" in shown.stdout
