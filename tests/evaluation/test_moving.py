"""A belt that runs, through the robot's own loop over a real service: only who leads the cube gets it."""

import json
from dataclasses import replace

from typer.testing import CliRunner

from app.cli import application
from app.evaluation.ledger import digest_of
from app.evaluation.sweeps import LOOKING, SWEEPS


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
