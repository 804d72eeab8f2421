"""A demonstration by hand, from a terminal's keys to a stored episode."""

import os
import pty
import time

import httpx
import numpy as np
import pytest
import typer

from app.cli.record import _opened, _upload
from app.evaluation.server import free_port
from roboprompt_client import cli
from roboprompt_client.recording.spool import Spool
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import ObjectPose
from roboprompt_client.trajectory_npz import trajectory_from_npz
from tests.e2e.processes import running_server
from tests.episodes import pick_trajectory
from tests.forked import Forked, run

PATIENCE_S = 60
TAPS = " " + "f" * 5


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    with running_server(tmp_path_factory.mktemp("record")) as url:
        yield url


class Terminal:
    """The command in a terminal of its own."""

    def __init__(self, *words):
        self._ours, theirs = pty.openpty()
        with os.fdopen(theirs, "r+b", buffering=0) as screen:
            self.process = Forked(["app.cli", "record", *words], {}, screen, keys=screen)
        self.said = ""

    def press(self, keys):
        os.write(self._ours, keys.encode())

    def until(self, text):
        deadline_s = time.monotonic() + PATIENCE_S
        while text not in self.said:
            assert time.monotonic() < deadline_s, self.said
            try:
                self.said += os.read(self._ours, 4096).decode(errors="replace")
            except OSError:  # the command has ended
                break
        assert text in self.said, self.said

    def close(self):
        self.process.kill()
        self.process.wait()
        os.close(self._ours)


@pytest.fixture
def terminal(url, tmp_path):
    scene = ["--task", "push_button", "--seed", "0", "--name", "by-hand"]
    terminal = Terminal(*scene, "--url", url, "--spool", str(tmp_path / "spool"))
    yield terminal
    terminal.close()


def test_what_the_keys_did_is_stored(terminal, tmp_path):
    terminal.until("gripper open")  # the table, which stands while keys are read
    for key in TAPS:
        terminal.press(key)
        time.sleep(0.3)
    terminal.until("gripper closed")
    terminal.press("\n")
    terminal.until("stored as")
    assert terminal.process.wait(PATIENCE_S) == 0
    assert "not solved" in terminal.said
    assert list((tmp_path / "spool").iterdir()) == []


def test_what_is_given_up_is_not(terminal):
    """Keys that are pressed before the arm is there count."""
    terminal.press("f")
    terminal.press("x")
    terminal.until("not solved")
    assert terminal.process.wait(PATIENCE_S) == 0
    assert "stored" not in terminal.said


def test_without_a_terminal_there_are_no_keys(url):
    done = run("app.cli", "record", "--url", url)
    assert done.returncode == 2
    assert "standard input is none" in " ".join(done.stderr.replace("│", " ").split())


def test_what_the_service_does_not_take_is_kept_and_uploaded_later(url, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("roboprompt_client.recording.spool.WAITS_S", ())
    spool, recorded = Spool(tmp_path), pick_trajectory((0.25, 0.05, 0.9))
    seen = Observation((ObjectPose("cube", [0.25, 0.05, 0.9], [0, 0, 0, 1]),))
    how = {"control_frequency_hz": 10.0, "extra": {"seed": 4}}
    folder = spool.keep("kept", "pick up the cube", seen, recorded, **how)
    with pytest.raises(typer.Exit):
        _upload(f"http://127.0.0.1:{free_port()}", spool, folder)
    said = " ".join(capsys.readouterr().err.split())
    assert f"kept in {folder}, to be uploaded by: roboprompt-robot --url" in said
    later = ["--url", url, *said.partition("--url ")[2].split()[1:]]
    for number in (1, 1):  # the second time there is nothing to send
        monkeypatch.setattr("sys.argv", ["roboprompt-robot", *later])
        assert cli.main() == 0
        episodes = httpx.get(f"{url}/episodes", params={"task": "kept"}).json()["episodes"]
        assert len(episodes) == number
    stored = httpx.get(f"{url}/episodes/{episodes[0]['id']}/metadata").json()
    assert (stored["extra"], stored["control_frequency_hz"]) == ({"seed": 4}, 10.0)
    trajectory = httpx.get(f"{url}/episodes/{episodes[0]['id']}/trajectory").content
    np.testing.assert_array_equal(trajectory_from_npz(trajectory).positions_m, recorded.positions_m)


def test_what_the_service_refuses_is_kept_and_said(url, tmp_path, capsys):
    spool = Spool(tmp_path)
    nowhere = Observation((ObjectPose("cube", [0.25, 0.05, 0.9], [0, 0, 0, 1]),))
    folder = spool.keep("a task; with a semicolon", "pick", nowhere, pick_trajectory((0.25, 0.05, 0.9)))
    with pytest.raises(typer.Exit):
        _upload(url, spool, folder)
    said = " ".join(capsys.readouterr().err.split())
    assert "refused: " in said
    assert f"kept in {folder}" in said
    assert (folder / "trajectory.npz").exists()


def test_a_folder_that_cannot_be_made_is_refused_before_anything_is_recorded(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(typer.BadParameter, match="valid: a folder"):
        _opened(tmp_path / "file")
