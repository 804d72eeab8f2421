"""Scenes that change after the answer, and belts that run, through the robot's own loop over a real service."""

import json
from dataclasses import replace

from typer.testing import CliRunner

from app.cli import application
from app.evaluation.ledger import digest_of, document_of, outcome_of
from app.evaluation.methods import Method, with_shift
from app.evaluation.sweeps import COPY, LOOKING, SWEEPS
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
    assert digest_of(default, {}) != digest_of(Method("default", source="robot loop"), {})
    assert digest_of(default, {}) != digest_of(replace(default, look_again=True), {})


def test_a_ledger_keeps_the_shift():
    kept = replace(trial("stack_cube", 1, "look again", succeeded=True), shift_m=0.03)
    assert outcome_of(document_of(kept)).shift_m == 0.03


def test_looking_again_saves_what_a_shift_spoils(tmp_path):
    scenes = ["--shift", "0.03", "--task", "stack_cube", "--episodes", "2", "--demos", "4", "--model", "nearest"]
    run = CliRunner().invoke(application, ["eval", *scenes, "--no-report", "--json", "--out", str(tmp_path)])
    assert run.exit_code == 0, run.output
    assert (tmp_path / "table.md").read_text().startswith("# Objects moved by 0.03 m after the answer")
    figures = json.loads(run.stdout.splitlines()[-1])["tasks"]["stack_cube"]["methods"]
    assert {name: (f["successes"], f["trials"]) for name, f in figures.items()} == {
        "default": (0, 2),
        "look again": (2, 2),
    }


def test_only_the_lead_differs():
    answered, again, leading = SWEEPS["moving"].methods
    assert [method.source for method in (answered, again, leading)] == ["robot loop"] * 3
    assert again == LOOKING == replace(leading, label="look again", lead_s=0.0)
    assert len({digest_of(replace(method, label="x"), {}) for method in (answered, again, leading)}) == 3


def test_two_looks_and_a_clock_catch_the_cube(tmp_path):
    """At 2 and 5 cm/s; at 10 not every scene is solved (docs/results/moving.md)."""
    scenes = ["--sweep", "moving", "--task", "pick_from_conveyor", "--seed", "100002", "--episodes", "2"]
    options = ["--demos", "3", "--model", "nearest", "--no-report", "--json", "--out", str(tmp_path)]
    run = CliRunner().invoke(application, ["eval", *scenes, *options])
    assert run.exit_code == 0, run.output
    figures = json.loads(run.stdout.splitlines()[-1])["tasks"]["pick_from_conveyor"]["methods"]
    solved = {name: (f["successes"], f["trials"]) for name, f in figures.items()}
    assert solved["look again and lead"] == (2, 2)
    assert solved["as answered"] == solved["look again"] == (0, 2)
