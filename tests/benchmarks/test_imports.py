"""Benchmarks are run seldom: what they take from each other is there."""

import importlib
from pathlib import Path

import pytest

import benchmarks.bench

FOLDER = Path(benchmarks.bench.__file__).parent
NAMES = sorted(path.stem for path in FOLDER.glob("*.py"))


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_can_be_imported(name):
    importlib.import_module(f"benchmarks.{name}")
