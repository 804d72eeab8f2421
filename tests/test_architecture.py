"""The direction of imports, as ARCHITECTURE.md draws it; the contracts are in pyproject.toml."""

from importlinter.cli import lint_imports


def test_imports_run_one_way(capsys):
    assert lint_imports(no_logo=True, no_cache=True) == 0, capsys.readouterr().out
