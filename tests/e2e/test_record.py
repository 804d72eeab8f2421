"""A demonstration by hand, from a terminal's keys to a stored episode."""

import os
import pty
import subprocess
import sys
import time

import pytest

from tests.e2e.processes import running_server

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
        command = [sys.executable, "-m", "app.cli", "record", *words]
        self.process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs)
        os.close(theirs)
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
def terminal(url):
    terminal = Terminal("--task", "push_button", "--seed", "0", "--name", "by-hand", "--url", url)
    terminal.until("push the red button")
    terminal.until("red button")
    yield terminal
    terminal.close()


def test_what_the_keys_did_is_stored(terminal, url):
    for key in TAPS:
        terminal.press(key)
        time.sleep(0.3)
    terminal.until("gripper closed")
    terminal.press("\n")
    terminal.until("stored as")
    assert terminal.process.wait(PATIENCE_S) == 0
    assert "not solved" in terminal.said


def test_what_is_given_up_is_not(terminal):
    terminal.press("f")
    terminal.press("x")
    terminal.until("not solved")
    assert terminal.process.wait(PATIENCE_S) == 0
    assert "stored" not in terminal.said


def test_without_a_terminal_there_are_no_keys(url):
    done = subprocess.run(
        [sys.executable, "-m", "app.cli", "record", "--url", url],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert "standard input is none" in " ".join(done.stderr.replace("│", " ").split())
