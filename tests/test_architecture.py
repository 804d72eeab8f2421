"""The direction of imports, as ARCHITECTURE.md draws it; the contracts are in pyproject.toml."""

import subprocess
import sys
from pathlib import Path


def test_imports_run_one_way():
    """In a process of its own: import-linter turns off the loggers that there are."""
    command = [Path(sys.executable).with_name("lint-imports"), "--no-cache"]
    linted = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True, check=False)
    assert linted.returncode == 0, linted.stdout
