"""How near a driver came to its poses, over a run."""

from dataclasses import replace

import pytest

from app.evaluation.methods import Method
from app.evaluation.results import Evaluation, TaskEvaluation
from app.evaluation.scores import reached
from tests.evaluation.trials import trial


def evaluation(*misses):
    done = [trial("push_button", 100_000 + k, "default", succeeded=True) for k in range(len(misses))]
    trials = [replace(one, execution=replace(one.execution, misses=of)) for one, of in zip(done, misses, strict=True)]
    unexecuted = replace(done[0], execution=None, error="no list of actions")
    return Evaluation("", (Method("default"),), (TaskEvaluation("push_button", (), (*trials, unexecuted)),), 1.0)


def test_every_action_counts_once():
    found = reached(evaluation(((0.001, 0.2), (0.004, 0.1)), ((0.002, 0.6),)))
    assert (found.poses, found.median_mm, found.worst_mm) == (3, pytest.approx(2.0), pytest.approx(4.0))
    assert (found.median_deg, found.worst_deg) == (0.2, 0.6)
    assert str(found) == "3 poses reached: off by 2 mm in the median, 4 mm at worst (0.2 and 0.6 degrees)"


def test_the_direct_simulation_reaches_by_itself():
    assert reached(evaluation((), ())) is None
