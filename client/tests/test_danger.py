"""Predictions that the service itself calls dangerous."""

import pytest
from arms import ACTIONS, Arm, Service

from roboprompt_client.answers import PredictedActions
from roboprompt_client.errors import DangerError, InvalidAnswerError, InvalidInputError, NotConfirmedError
from roboprompt_client.runs.loop import run_task


def finding(severity="danger", where="objects[cube]"):
    return {"code": "object-tilted", "severity": severity, "message": "cube is tilted by 90 degrees.", "where": where}


def run(arm, *findings, **settings):
    service = Service(PredictedActions("p", ACTIONS, {"findings": list(findings)}))
    return run_task(service, arm, "pick", "pick up the cube", **settings)


@pytest.mark.parametrize("settings", [{}, {"confirm": lambda index, action: True}])
def test_a_danger_is_refused_without_an_answer_to_it(settings):
    arm = Arm()
    with pytest.raises(DangerError, match="cube is tilted by 90 degrees"):
        run(arm, finding(), **settings)
    assert (arm.heights, arm.stopped) == ([], 1)


def test_each_danger_is_asked_about_once_before_anything_moves(caplog):
    asked, arm = [], Arm()
    run(arm, finding(), finding("warning"), on_danger=lambda message: asked.append((message, len(arm.heights))) or True)
    assert asked == [("cube is tilted by 90 degrees.", 0)]
    assert len(arm.heights) == 3
    assert "cube is tilted by 90 degrees" in caplog.text


def test_a_no_says_what_was_dangerous_and_moves_nothing():
    arm = Arm()
    with pytest.raises(NotConfirmedError, match=r"the danger was not allowed: cube is tilted"):
        run(arm, finding(), on_danger=lambda message: False, confirm=lambda index, action: pytest.fail("asked"))
    assert (arm.heights, arm.stopped) == ([], 1)


@pytest.mark.parametrize(
    ("findings", "settings"), [([finding("warning"), finding("info")], {}), ([finding()], {"on_danger": "go"})]
)
def test_other_findings_and_on_danger_go_let_it_pass(findings, settings):
    arm = Arm()
    run(arm, *findings, **settings)
    assert len(arm.heights) == 3


def test_a_setting_that_cannot_be():
    arm, service = Arm(), Service(PredictedActions("p", ACTIONS[:1], {"findings": []}))
    with pytest.raises(InvalidInputError, match="refuse, go, or a function"):
        run_task(service, arm, "pick", "pick up the cube", on_danger="ask")
    assert (arm.heights, arm.stopped, service.asked) == ([], 1, 0)


# What is no list of findings that says whether there is a danger, and what the error says of it.
MALFORMED = [
    ({}, "findings is missing"),
    ({"findings": None}, "findings is None"),
    ({"findings": {}}, "findings is {}"),
    ({"findings": "none"}, "findings is 'none'"),
    ({"findings": [None]}, r"findings\[0\] is None"),
    ({"findings": [finding("info"), {"code": "object-tilted"}]}, r"findings\[1\] is {'code': 'object-tilted'}"),
    ({"findings": [finding(None)]}, r"findings\[0\] is .*'severity': None"),
    ({"findings": [finding("DANGER")]}, "'severity': 'DANGER'"),
    ({"findings": [finding(["danger"])]}, r"'severity': \['danger'\]"),
]


@pytest.mark.parametrize(("response", "said"), MALFORMED)
@pytest.mark.parametrize("on_danger", ["refuse", "go"])
def test_findings_that_are_not_well_formed_move_nothing(response, said, on_danger):
    arm, service = Arm(), Service(PredictedActions("p", ACTIONS[:1], response))
    with pytest.raises(InvalidAnswerError, match=f"the service's answer: .*{said}.*a list of objects"):
        run_task(service, arm, "pick", "pick it up", on_danger=on_danger)
    assert (arm.heights, arm.stopped) == ([], 1)
