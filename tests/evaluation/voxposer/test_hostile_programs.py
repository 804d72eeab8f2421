"""What a program must not be able to do, each refused with an error that says why."""

import time

import pytest

from app.evaluation.baselines.voxposer.program.child import answer_to
from app.evaluation.baselines.voxposer.sandbox import run_program
from app.evaluation.failures import ProgramRefusedError
from tests.evaluation.voxposer.scenes import GO, SCENE

NESTED = "[" * 60 + "1" + "]" * 60
DEEP = "x = " + "+".join(["1"] * 3000)
HOSTILE = {
    "import": ("import os\n", "line 1: Import is not allowed"),
    "import from": ("from socket import socket\n", "line 1: ImportFrom is not allowed"),
    "open a file": ("x = open('/etc/passwd')\n", "line 1: the function 'open' is not known"),
    "import by call": ("x = __import__('os')\n", "line 1: the function '__import__' is not known"),
    "exec": ("exec('x = 1')\n", "the function 'exec' is not known"),
    "eval": ("x = eval('1')\n", "the function 'eval' is not known"),
    "getattr": ("x = getattr(1, '__class__')\n", "is not known"),
    "walk up from a constant": ("x = ().__class__.__bases__\n", "the attribute '__bases__' is not known"),
    "globals of a function": ("x = detect.__globals__\n", "the attribute '__globals__' is not known"),
    "pose of a thing": ("x = detect('cube').position_m\n", "the attribute 'position_m' is not known"),
    "endless loop": ("while True:\n    pass\n", "line 1: While is not allowed"),
    "loops in loops": (
        "for a in range(9999):\n    for b in range(9999):\n        c = a * b\n",
        "takes more than 100000 steps",
    ),
    "huge range": ("for a in range(10 * 1000000):\n    pass\n", "a range has 10000000 items"),
    "memory by repetition": ("x = [0] * 1000000000\n", "arithmetic takes numbers only"),
    "memory by doubling": ("x = 2\nfor a in range(99):\n    x = x * x\n", "line 3: a number is beyond 1e+09"),
    "tower of powers": ("x = 10 ** 10 ** 10\n", "Pow is not allowed"),
    "shift": ("x = 1 << 1000000000\n", "LShift is not allowed"),
    "long text": ("x = 'a' * 1000000000\n", "arithmetic takes numbers only"),
    "many digits": (f"x = {'9' * 4000}\n", "a number is beyond 1e+09"),
    "format of a text": ("x = '%1000000000d' % 1\n", "arithmetic takes numbers only"),
    "method of a text": ("x = '{0.__class__}'.format(1)\n", "the attribute 'format' is not known"),
    "format string": ("x = f'{detect}'\n", "JoinedStr is not allowed"),
    "recursion": ("def f(x):\n    return f(x)\nf(1)\n", "functions call each other more than 16 deep"),
    "comprehension": ("x = [a for a in range(9) for b in range(9)]\n", "ListComp is not allowed"),
    "frames of a generator": ("x = (a for a in range(9)).gi_frame\n", "is not known"),
    "default of a lambda": ("f = lambda x=detect: x\n", "Lambda is not allowed"),
    "default of a def": ("def f(x=1):\n    pass\n", "def takes plain parameters only"),
    "decorator": ("@detect\ndef f():\n    pass\n", "def takes plain parameters only"),
    "class": ("class A:\n    pass\n", "ClassDef is not allowed"),
    "swallowed errors": (
        "for a in range(9):\n    try:\n        detect('x')\n    except:\n        pass\n",
        "Try is not",
    ),
    "another function instead": ("move = 1\n", "move is a function and cannot be assigned to"),
    "another function by def": ("def move(x):\n    pass\n", "move is a function already"),
    "attribute of a thing": ("detect('cube').position = 1\n", "the attribute 'position' is not known"),
    "look-alike name": ("d\u0435tect('cube')\n", "has letters beyond ASCII"),
    "wide letters": ("\uff44etect('cube')\n", "has letters beyond ASCII"),
    "flood of text": ("for a in range(99):\n    print('x')\n", "the function 'print' is not known"),
    "nested brackets": (f"x = {NESTED}\n", "nested too deeply"),
    "nested sum": (DEEP, "nested too deeply"),
    "long program": ("x = 1\n" * 5000, "the program has 30000 characters"),
    "names from outside": ("global move\n", "Global is not allowed"),
    "deletion": ("del move\n", "Delete is not allowed"),
    "star of arguments": ("detect(*['cube'])\n", "Starred is not allowed"),
    "keywords": ("detect(**{})\n", "Dict is not allowed"),
    "async": ("async def f():\n    pass\n", "AsyncFunctionDef is not allowed"),
    "walrus": ("(move := 1)\n", "NamedExpr is not allowed"),
    "flood of paint": (
        "m = empty_gripper_map()\nfor a in range(9999):\n    m[1, 1, 1] = 1\n",
        "painted in more than 5000 places",
    ),
    "flood of voxels": (
        "t = empty_affordance_map()\nfor a in range(990):\n    t[0:99, :, :] = 1\nmove(t)\n",
        "hold more than",
    ),
    "flood of moves": (GO + "for a in range(99):\n    move(target)\n", "moves more than 40 times"),
    "comparison of towers": (
        "x = 1\ny = 1\nfor a in range(99):\n    x = (x, x)\n    y = (y, y)\nz = x == y\n",
        "only numbers and texts can be compared",
    ),
    "null byte": ("x = 1\0\n", "is no Python"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_program_is_refused(name):
    program, why = HOSTILE[name]
    started_s = time.process_time()
    answer = answer_to({"program": program, "scene": SCENE.to_json()})
    assert why in answer["error"]
    assert "moves" not in answer
    assert time.process_time() - started_s < 2


@pytest.mark.parametrize("name", ["nested sum", "loops in loops", "memory by doubling", "walk up from a constant"])
def test_hostile_program_is_refused_by_its_process(name):
    program, why = HOSTILE[name]
    with pytest.raises(ProgramRefusedError) as caught:
        run_program(program, SCENE)
    assert why in str(caught.value)
