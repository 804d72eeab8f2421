"""The process of a program: what it may take, and how it ends."""

import subprocess
import sys

import pytest

from app.evaluation.baselines.voxposer import sandbox
from app.evaluation.baselines.voxposer.sandbox import COMMAND, ROOT, run_program
from app.evaluation.failures import ProgramRefusedError
from tests.evaluation.voxposer.scenes import GO, SCENE

CONFINED = (
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from app.evaluation.baselines.voxposer.program import child; "
)


def confined(code):
    """What Python code does in a process that has given up its rights; programs never get that far."""
    command = [sys.executable, "-I", "-S", "-B", "-c", f"{CONFINED}import socket, os; child.give_up_rights(); {code}"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def instead(monkeypatch, code):
    monkeypatch.setattr(sandbox, "COMMAND", (*COMMAND[:-1], f"{CONFINED}{code}"))


@pytest.mark.parametrize(
    ("code", "error"),
    [
        ("open('/etc/passwd')", "Too many open files"),
        ("socket.socket()", "Too many open files"),
        ("os.pipe()", "Too many open files"),
        ("b'x' * 2**30", "MemoryError"),
    ],
)
def test_the_process_itself_has_no_files_no_network_and_little_memory(code, error):
    ended = confined(code)
    assert ended.returncode == 1
    assert error in ended.stderr


def test_a_process_that_computes_on_is_ended(monkeypatch):
    monkeypatch.setattr(sandbox, "WALL_S", 30.0)
    instead(monkeypatch, "child.give_up_rights(); any(iter(int, 1))")
    with pytest.raises(ProgramRefusedError, match="too much processor time"):
        run_program(GO, SCENE)


def test_a_process_that_waits_is_ended(monkeypatch):
    monkeypatch.setattr(sandbox, "WALL_S", 0.3)
    instead(monkeypatch, "import time; time.sleep(60)")
    with pytest.raises(ProgramRefusedError, match=r"took more than 0\.3 s"):
        run_program(GO, SCENE)


def test_a_process_that_dies_says_how(monkeypatch):
    instead(monkeypatch, "import os; os.kill(os.getpid(), 11)")
    with pytest.raises(ProgramRefusedError, match="ended with SIGSEGV"):
        run_program(GO, SCENE)


def test_the_answer_is_what_was_painted():
    assert run_program(GO, SCENE) == [{"affordance": [[[[50, 51], [60, 61], [20, 21]], 1]]}]


def test_the_process_does_not_see_the_environment(monkeypatch):
    monkeypatch.setenv("ROBOPROMPT_SECRET", "key")
    instead(monkeypatch, "import os, json; print(json.dumps({'error': str(dict(os.environ))}))")
    with pytest.raises(ProgramRefusedError) as caught:
        run_program(GO, SCENE)
    assert "key" not in str(caught.value)
