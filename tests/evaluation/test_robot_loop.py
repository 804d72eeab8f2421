"""Scenes that change after the answer, through the robot's own loop over a real service."""

import json
from dataclasses import replace

from typer.testing import CliRunner

from app.cli import application
from app.evaluation.ledger import document_of, outcome_of
from app.evaluation.methods import COPY, Method, with_shift
from tests.evaluation.trials import trial


def test_a_shift_gives_each_method_one_beside_it_that_looks_again():
    default, again, copy, copy_again = with_shift((Method("default"), COPY), 0.03)
    assert [m.label for m in (default, again, copy, copy_again)] == [
        "default",
        "look again",
        COPY.label,
        f"{COPY.label}, look again",
    ]
    assert [m.look_again for m in (default, again)] == [False, True]
    assert {m.shift_m for m in (default, again, copy, copy_again)} == {0.03}


def test_a_ledger_keeps_the_shift():
    kept = replace(trial("stack_cube", 1, "look again", succeeded=True), shift_m=0.03)
    assert outcome_of(document_of(kept)).shift_m == 0.03


def test_looking_again_saves_what_a_shift_spoils(tmp_path):
    scenes = ["--shift", "0.03", "--task", "stack_cube", "--episodes", "2", "--demos", "4", "--model", "nearest"]
    run = CliRunner().invoke(application, ["eval", *scenes, "--json", "--out", str(tmp_path)])
    assert run.exit_code == 0, run.output
    assert (tmp_path / "table.md").read_text().startswith("# Objects moved by 0.03 m after the answer")
    figures = json.loads(run.stdout.splitlines()[-1])["tasks"]["stack_cube"]["methods"]
    assert {name: (f["successes"], f["trials"]) for name, f in figures.items()} == {
        "default": (0, 2),
        "look again": (2, 2),
    }
