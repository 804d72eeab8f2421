"""The process of a program: what a program must not be able to do, what the process may take, and how it ends."""

import subprocess
import sys

import pytest

from app.evaluation.failures import ProgramRefusedError
from app.evaluation.voxposer import sandbox
from app.evaluation.voxposer.program import answer_to
from app.evaluation.voxposer.sandbox import COMMAND, ROOT, run_program
from tests.evaluation.voxposer.scenes import GO, SCENE

CONFINED = f"import sys; sys.path.insert(0, {str(ROOT)!r}); from app.evaluation.voxposer import program; "


def confined(code):
    """What Python code does in a process that has given up its rights; programs never get that far."""
    command = [sys.executable, "-I", "-S", "-B", "-c", f"{CONFINED}import socket, os; program.give_up_rights(); {code}"]
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
    instead(monkeypatch, "program.give_up_rights(); any(iter(int, 1))")
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


HOSTILE = {
    "import": ("import os\n", "line 1: Import is not allowed"),
    "import from": ("from socket import socket\n", "line 1: ImportFrom is not allowed"),
    "open a file": ("x = open('/etc/passwd')\n", "line 1: name 'open' is not defined"),
    "import by call": ("x = __import__('os')\n", "line 1: name '__import__' is not defined"),
    "builtins": ("x = __builtins__['open']\n", "line 1: 'open'"),
    "exec": ("exec('x = 1')\n", "name 'exec' is not defined"),
    "getattr": ("x = getattr(1, '__class__')\n", "name 'getattr' is not defined"),
    "walk up from a constant": ("x = ().__class__.__bases__\n", "the attribute '__bases__' is not known"),
    "globals of a function": ("x = detect.__globals__\n", "the attribute '__globals__' is not known"),
    "wide letters of an attribute": ("x = detect.__\uff47lobals__\n", "the attribute '__globals__' is not known"),
    "pose of a thing": ("x = detect('cube').position_m\n", "the attribute 'position_m' is not known"),
    "endless loop": ("while True:\n    pass\n", "line 1: While is not allowed"),
    "method of a text": ("x = '{0.__class__}'.format(1)\n", "the attribute 'format' is not known"),
    "format string": ("x = f'{detect}'\n", "JoinedStr is not allowed"),
    "attributes by a pattern": ("match 1:\n    case object(__class__=x):\n        pass\n", "Match is not allowed"),
    "recursion": ("def f(x):\n    return f(x)\nf(1)\n", "nested too deeply"),
    "frames of a generator": ("x = (a for a in range(9)).gi_frame\n", "is not"),
    "default of a lambda": ("f = lambda x=detect: x\n", "Lambda is not allowed"),
    "class": ("class A:\n    pass\n", "ClassDef is not allowed"),
    "swallowed errors": ("try:\n    detect('x')\nexcept:\n    pass\n", "Try is not"),
    "attribute of a thing": ("detect('cube').position = 1\n", "the attribute 'position' is not known"),
    "names from outside": ("global move\n", "Global is not allowed"),
    "flood of paint": (
        "t = empty_affordance_map()\nfor a in range(9999):\n    t[1, 1, 1] = 1\nmove(t)\n",
        "painted in more than 5000 places",
    ),
    "flood of moves": (GO + "for a in range(99):\n    move(target)\n", "moves more than 40 times"),
    "null byte": ("x = 1\0\n", "is no Python"),
}
# These end the process, or would take the memory of this one.
COSTLY = {
    "loops in loops": (
        "for a in range(99999):\n    for b in range(99999):\n        c = a * b\n",
        "too much processor time",
    ),
    "memory by repetition": ("x = [0] * 1000000000\n", "takes too much memory"),
    "format of a text": ("x = '%1000000000d' % 1\n", "takes too much memory"),
    "comparison of towers": (
        "x = 1\ny = 1\nfor a in range(99):\n    x = (x, x)\n    y = (y, y)\nz = x == y\n",
        "too much processor time",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_program_is_refused(name):
    program, why = HOSTILE[name]
    answer = answer_to({"program": program, "scene": SCENE.to_json()})
    assert why in answer["error"]
    assert "moves" not in answer


@pytest.mark.parametrize("name", COSTLY)
def test_costly_program_is_ended(name):
    program, why = COSTLY[name]
    with pytest.raises(ProgramRefusedError, match=why):
        run_program(program, SCENE)
