"""No part of the service reads a pickle, or runs what it reads."""

import ast
from pathlib import Path

APP = Path(__file__).parents[1] / "app"
FORBIDDEN_MODULES = {"pickle", "cPickle", "_pickle", "marshal", "shelve", "dill", "joblib", "cloudpickle"}
# Conversion on the caller's side, with an unpickler that makes nothing but arrays; the service never imports it.
EXEMPT = {APP / "datasets"}
FORBIDDEN_CALLS = {"eval", "exec", "compile", "__import__"}


def modules():
    for path in sorted(APP.rglob("*.py")):
        if not any(folder in path.parents for folder in EXEMPT):
            yield path, ast.parse(path.read_text())


def test_no_module_that_unpickles():
    for path, tree in modules():
        for node in ast.walk(tree):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not {name.partition(".")[0] for name in names} & FORBIDDEN_MODULES, path


def careless_loads(tree):
    """The calls by which numpy reads a file that might hold a pickle, and that do not forbid it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(
            ("np.load", "numpy.load", "format.read_array")
        ):
            given = {word.arg: ast.unparse(word.value) for word in node.keywords}
            if given.get("allow_pickle") != "False":
                yield node.lineno


def test_numpy_never_unpickles():
    for path, tree in modules():
        assert not list(careless_loads(tree)), path


def test_a_careless_load_would_be_found():
    assert list(careless_loads(ast.parse("import numpy as np\nnp.load(file)"))) == [2]
    assert list(careless_loads(ast.parse("np.lib.format.read_array(file, allow_pickle=True)"))) == [1]
    assert not list(careless_loads(ast.parse("np.load(file, allow_pickle=False)")))


def test_nothing_is_run_that_was_read():
    for path, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                assert not (isinstance(node.func, ast.Name) and node.func.id in FORBIDDEN_CALLS), path
                assert not [word for word in node.keywords if word.arg == "shell"], path
