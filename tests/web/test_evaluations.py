"""Tasks of evaluations stand apart from those that people taught."""

import pytest

from app.evaluation import run
from app.evaluation.methods import Method
from app.evaluation.plan import Plan
from app.web.page import by_origin, is_evaluated, task_text


def test_the_names_that_evaluations_give_are_known(monkeypatch):
    given = []
    monkeypatch.setattr(run, "upload", lambda client, name, *rest: given.append(name))
    plan = Plan(("push_button",), (), 1, 1, "eval", images=True)
    run.PlanRun(plan, None, None, None, None, shared=True)._upload("push_button", "-vision", Method("default"), (), ())
    assert is_evaluated(given[0])
    assert task_text(given[0]) == f"push_button-vision, evaluation {given[0][-6:]}"


@pytest.mark.parametrize("name", ["push_button", "a.eval-12", ".eval-fe7416", "a.eval-fe7416.b", "a.eval-FE7416"])
def test_other_names_stay(name):
    assert not is_evaluated(name)
    assert task_text(name) == name


def test_they_stand_apart():
    assert by_origin(["b", "a.eval-fe7416", "a"]) == (["b", "a"], ["a.eval-fe7416"])
