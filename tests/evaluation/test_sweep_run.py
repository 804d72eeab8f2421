"""`roboprompt eval` as people run it: interrupted, killed, gone on with, and finished."""

import json
import os
import signal
import sys
import time
from contextlib import contextmanager
from tempfile import TemporaryFile

import pytest
from typer.testing import CliRunner

from app.cli import application
from app.evaluation.methods import REGRESSION
from tests.evaluation.processes import alive, descendants
from tests.forked import Forked

TASKS = ("push_button", "open_drawer")
NUM_TRIALS = 2 * 2 * 4  # tasks, seeds, methods
PATIENCE_S = 90


def arguments(folder):
    tasks = [word for task in TASKS for word in ("--task", task)]
    few = ["--episodes", "2", "--demos", "2", "--model", "regression", "--json"]
    return ["eval", *tasks, *few, "--out", str(folder)]


@contextmanager
def started(folder):
    """The command at work; `said` waits until it ends and returns what it wrote to its two outputs."""
    with TemporaryFile("w+") as out, TemporaryFile("w+") as errors:
        run = Forked(["app.cli", *arguments(folder)], {}, out, errors, new_session=True)

        def said():
            run.wait(PATIENCE_S)
            for file in (out, errors):
                file.seek(0)
            return out.read(), errors.read()

        run.said = said
        try:
            yield run
        finally:
            run.kill()


def results(folder):
    path = folder / "results.jsonl"
    return [json.loads(line) for line in path.read_bytes().split(b"\n")[:-1]] if path.exists() else []


def wait_for(condition, what):
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.01)


def keys(lines):
    return [(line["task"], line["seed"], line["method"]) for line in lines]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("eval") / "results"


def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(folder):
    with started(folder) as run:
        wait_for(lambda: results(folder), "no first trial")
        processes = descendants(run.pid)
        os.killpg(run.pid, signal.SIGINT)  # as a terminal does: to the workers as well
        out, errors = run.said()
    assert run.returncode == 130, errors
    assert "Traceback" not in errors
    assert f"--out {folder}" in errors
    done = len(results(folder))
    assert 0 < done < NUM_TRIALS
    summary = json.loads(out.splitlines()[-1])
    assert (summary["remaining"], summary["stopped"]) == (NUM_TRIALS - done, "interrupted")
    assert (folder / "table.md").exists()
    assert len(processes) >= 3  # service and workers
    wait_for(lambda: not any(map(alive, processes)), "processes outlived the run")


def test_a_killed_run_leaves_no_processes_and_no_damage(folder):
    before = len(results(folder))
    with started(folder) as run:
        wait_for(lambda: len(results(folder)) > before, "no further trial")
        processes = descendants(run.pid)
        run.kill()
        run.wait(PATIENCE_S)
    assert len(processes) >= 3
    wait_for(lambda: not any(map(alive, processes)), "processes outlived the run")
    assert before < len(results(folder)) < NUM_TRIALS


def test_the_rest_is_run_and_nothing_twice(folder):
    kept = results(folder)
    with started(folder) as run:
        out, errors = run.said()
    assert run.returncode == 0, errors
    assert results(folder)[: len(kept)] == kept
    assert len(set(keys(results(folder)))) == len(results(folder)) == NUM_TRIALS
    summary = json.loads(out.splitlines()[-1])
    assert (summary["trials"], summary["errors"], summary["remaining"]) == (NUM_TRIALS, 0, 0)
    assert summary["tasks"]["open_drawer"]["methods"]["expert replay"]["trials"] == 2
    assert summary["tasks"]["open_drawer"].keys() >= {"successes", "trials", "success_rate"}
    assert {path.name for path in folder.iterdir()} == {"results.jsonl", "run.json", "table.md"}


def test_the_record_of_the_run(folder):
    record = json.loads((folder / "run.json").read_text())
    interrupted, killed, finished = record["sessions"]
    assert killed["ended"] is None
    assert interrupted["ended"] < finished["ended"]
    assert (record["sweep"], record["test_seeds"]) == ("main", [100_000, 100_001])
    assert finished["versions"]["python"] == sys.version.split()[0]
    assert finished["machine"]["cores"] >= 1


def test_a_finished_run_is_not_run_again(folder):
    before = (folder / "results.jsonl").read_bytes(), (folder / "run.json").read_bytes()
    (folder / "table.md").unlink()
    run = CliRunner().invoke(application, arguments(folder))
    assert run.exit_code == 0, run.output
    assert ((folder / "results.jsonl").read_bytes(), (folder / "run.json").read_bytes()) == before
    assert "| push_button |" in (folder / "table.md").read_text()


def test_other_recordings_scenes_and_methods(tmp_path):
    scenes = ["--recordings", "continuous", "--seed", "5", "--noise", "1"]
    methods = ["--method", "expert", "--method", "regression"]
    few = ["--task", "push_button", "--episodes", "2", "--demos", "2", "--json", "--out", str(tmp_path)]
    run = CliRunner().invoke(application, ["eval", *scenes, *methods, *few])
    assert run.exit_code == 0, run.output
    last = json.loads(run.stdout.splitlines()[-1])
    assert (last["recordings"], last["seed"], last["remaining"]) == ("continuous", 5, 0)
    figures = last["tasks"]["push_button"]
    assert (figures["successes"], figures["trials"], figures["success_rate"]) == (2, 2, 1.0)
    assert list(figures["methods"]) == ["expert", REGRESSION.label]
    kept = json.loads((tmp_path / "run.json").read_text())
    assert (kept["test_seeds"], kept["recordings"]) == ([5, 6], "continuous")
    assert [method["noise"] for method in kept["methods"]] == [0.0, 1.0]
