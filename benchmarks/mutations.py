"""Whether the tests notice deliberate mistakes: `python -m benchmarks.mutations [--tree FOLDER]`.

Each mistake of mutations.toml is made in a copy of the tree, and the tests that it names are run there. Prints
`noticed` (they fail, or hang), `NOT NOTICED`, or `STALE` where its text no longer stands in exactly one file or a test
file is gone; the exit status is 1 unless all are noticed.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIST = Path(__file__).with_suffix(".toml")
HANGS_S = 240.0
SOURCES = ("app", "client/roboprompt_client")
TESTS = ("tests", "client/tests")
FOLDERS = ("app", "benchmarks", "client", "docker", "docs", "migrations", "openapi", "tests")
FILES = ("pyproject.toml", "README.md")
NO_CACHES = shutil.ignore_patterns("__pycache__", ".venv", "*.egg-info")


def main() -> int:
    """Try every mistake; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tree", type=Path, default=ROOT, help="folder of the source tree to try them in")
    parser.add_argument("--only", default="", help="those whose description contains this")
    parser.add_argument("--first", type=int, default=1, help="begin with this one of the list")
    options = parser.parse_args()
    listed = tomllib.loads(LIST.read_text())["mutation"][options.first - 1 :]
    verdicts = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in FOLDERS:
            shutil.copytree(options.tree / name, copy / name, ignore=NO_CACHES)
        for name in FILES:
            shutil.copy(options.tree / name, copy / name)
        for mutation in listed:
            if options.only in mutation["breaks"]:
                started_s = time.monotonic()
                verdicts.append(tried(copy, mutation))
                print(f"{verdicts[-1]:12}{time.monotonic() - started_s:6.1f} s  {mutation['breaks']}", flush=True)  # noqa: T201
    noticed = verdicts.count("noticed")
    print(f"{noticed} of {len(verdicts)} noticed")  # noqa: T201
    return int(noticed < len(verdicts))


def tried(copy: Path, mutation: dict[str, str | list[str]]) -> str:
    """What became of one mistake in `copy`, which is as before afterwards."""
    old, new = str(mutation["old"]), str(mutation["new"])
    texts = {path: path.read_text() for folder in SOURCES for path in (copy / folder).rglob("*.py")}
    places = [path for path, text in texts.items() if old in text]
    tests = [path for name in mutation["tests"] for folder in TESTS for path in sorted((copy / folder).rglob(name))]
    if len(places) != 1 or texts[places[0]].count(old) != 1 or not tests:
        return "STALE"
    places[0].write_text(texts[places[0]].replace(old, new))
    try:
        return "noticed" if not passed(copy, tests) else "NOT NOTICED"
    finally:
        places[0].write_text(texts[places[0]])


def passed(copy: Path, tests: list[Path]) -> bool:
    """Whether all of the tests pass in `copy`."""
    command = [sys.executable, "-m", "pytest", "--quiet", "--exitfirst", "-p", "no:cacheprovider", *map(str, tests)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(copy), str(copy / "client")))}
    try:
        done = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, text=True, check=False, timeout=HANGS_S
        )
    except subprocess.TimeoutExpired:
        return False
    if done.returncode not in (0, 1):  # 1: a test failed; others: the run itself
        raise SystemExit(f"the tests could not be run:\n{done.stdout[-3000:]}{done.stderr[-2000:]}")
    return done.returncode == 0


if __name__ == "__main__":
    sys.exit(main())
