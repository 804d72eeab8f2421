"""Predictions that the service itself calls dangerous."""

import json

import httpx
import pytest
from arms import ACTIONS, Arm, Service

from roboprompt_client.answers import PredictedActions
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import DangerError, InvalidAnswerError, InvalidInputError, NotConfirmedError
from roboprompt_client.loop import run_closed_loop, run_task
from roboprompt_client.motion_limits import MotionLimits


def finding(severity="danger", where="objects[cube]"):
    return {"code": "object-tilted", "severity": severity, "message": "cube is tilted by 90 degrees.", "where": where}


def run(arm, *findings, **settings):
    service = Service(PredictedActions("p", ACTIONS, {"findings": list(findings)}))
    return run_task(service, arm, "pick", "pick up the cube", **settings)


@pytest.mark.parametrize("stream", [False, True])
def test_a_danger_is_refused_without_a_person_to_ask(stream):
    arm = Arm()
    with pytest.raises(DangerError, match="cube is tilted by 90 degrees"):
        run(arm, finding(), stream=stream)
    assert (arm.heights, arm.stopped) == ([], 1)


@pytest.mark.parametrize("stream", [False, True])
def test_a_person_is_asked_before_anything_moves(stream, caplog):
    asked, arm = [], Arm()

    def confirm(index, action):
        asked.append((index, len(arm.heights)))
        return True

    run(arm, finding(), finding("warning"), confirm=confirm, stream=stream)
    assert asked == [(0, 0), (0, 0), (1, 1), (2, 2)]
    assert "cube is tilted by 90 degrees" in caplog.text


def test_a_no_says_what_was_dangerous_and_moves_nothing():
    arm = Arm()
    with pytest.raises(NotConfirmedError, match=r"action 2 was not allowed: cube is tilted"):
        run(arm, finding(where="actions[1].position"), confirm=lambda index, action: index != 1)
    assert (arm.heights, arm.stopped) == ([], 1)


@pytest.mark.parametrize("stream", [False, True])
def test_other_findings_and_on_danger_go_let_it_pass(stream):
    for findings, settings in (([finding("warning"), finding("info")], {}), ([finding()], {"on_danger": "go"})):
        arm = Arm()
        run(arm, *findings, stream=stream, **settings)
        assert len(arm.heights) == 3


def test_a_danger_can_be_refused_although_somebody_is_there():
    with pytest.raises(DangerError):
        run(Arm(), finding(), on_danger="refuse", confirm=lambda index, action: True)


@pytest.mark.parametrize(("setting", "said"), [("ask", "confirm, refuse, go"), ("confirm", "no `confirm` to ask")])
def test_settings_that_cannot_be(setting, said):
    arm = Arm()
    with pytest.raises(InvalidInputError, match=said):
        run(arm, on_danger=setting)
    assert arm.stopped == 1


def loop(arm, *findings, steps=2, **settings):
    """A closed loop of a service that always wants the same action and finds the same."""
    service = Service(PredictedActions("p", ACTIONS[:1], {"findings": list(findings)}))
    seen = []
    try:
        for step in run_closed_loop(service, arm, "pick", "pick up the cube", max_steps=steps, **settings):
            seen.append(step)
    finally:
        assert len(seen) == service.asked  # who steps through it sees the answer that is refused, too
    return seen


def test_a_closed_loop_refuses_a_danger_before_its_step_is_taken():
    arm = Arm()
    with pytest.raises(DangerError, match="cube is tilted by 90 degrees"):
        loop(arm, finding())
    assert (arm.heights, arm.stopped) == ([], 1)


def test_a_closed_loop_asks_at_every_step_that_is_dangerous():
    arm, asked = Arm(), []

    def confirm(index, action):
        asked.append((index, len(arm.heights)))
        return len(asked) < 3

    with pytest.raises(NotConfirmedError, match="cube is tilted"):
        loop(arm, finding(), confirm=confirm)
    assert asked == [(0, 0), (0, 0), (0, 1)]  # the danger, the action, and the next step's danger
    assert (len(arm.heights), arm.stopped) == (1, 1)


def test_a_closed_loop_goes_on_where_told_to():
    for findings, settings in (([finding("warning")], {}), ([finding()], {"on_danger": "go"})):
        arm = Arm()
        assert len(loop(arm, *findings, **settings)) == 2
        assert len(arm.heights) == 2


def test_a_closed_loop_checks_its_setting_before_it_asks():
    arm = Arm()
    with pytest.raises(InvalidInputError, match="no `confirm` to ask"):
        loop(arm, on_danger="confirm")
    assert arm.stopped == 1


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
@pytest.mark.parametrize("on_danger", [None, "go"])
def test_findings_that_are_not_well_formed_move_nothing(response, said, on_danger):
    arm = Arm()
    with pytest.raises(InvalidAnswerError, match=f"the service's answer: .*{said}.*a list of objects"):
        run_task(Service(PredictedActions("p", ACTIONS, response)), arm, "pick", "pick it up", on_danger=on_danger)
    assert (arm.heights, arm.stopped) == ([], 1)


@pytest.mark.parametrize(("response", "said"), MALFORMED)
def test_a_closed_loop_does_not_move_by_findings_that_are_not_well_formed(response, said):
    arm = Arm()
    with pytest.raises(InvalidAnswerError, match=said):
        list(run_closed_loop(Service(PredictedActions("p", ACTIONS[:1], response)), arm, "pick", "pick it up"))
    assert (arm.heights, arm.stopped) == ([], 1)


def stream_of(*events):
    """A client of a service that streams these events."""
    body = "".join(f"event: {name}\ndata: {json.dumps(document)}\n\n" for name, document in events)
    answer = httpx.Response(200, text=body, headers={"content-type": "text/event-stream"})
    http = httpx.Client(transport=httpx.MockTransport(lambda _: answer), base_url="http://robots")
    return RoboPromptClient(connection=http)


def run_stream(arm, *events):
    return run_task(stream_of(*events), arm, "pick", "pick it up", stream=True, limits=MotionLimits())


ACTION = {"position": [0.1, 0.2, 0.9], "quaternion_xyzw": [1, 0, 0, 0], "gripper_open": True}
DONE = {"id": "p", "actions": [ACTION], "findings": []}


@pytest.mark.parametrize(("findings", "said"), MALFORMED)
def test_a_stream_does_not_move_by_findings_that_are_not_well_formed(findings, said):
    arm = Arm()
    with pytest.raises(InvalidAnswerError, match=said):
        run_stream(arm, ("findings", findings), ("action", ACTION), ("done", DONE))
    assert (arm.heights, arm.stopped) == ([], 1)


def test_a_stream_does_not_move_before_it_has_said_what_it_found():
    arm = Arm()
    with pytest.raises(InvalidAnswerError, match="did not come before the first action"):
        run_stream(arm, ("action", ACTION), ("findings", {"findings": []}), ("done", DONE))
    assert (arm.heights, arm.stopped) == ([], 1)
    run_stream(arm, ("findings", {"findings": []}), ("action", ACTION), ("done", DONE))
    assert arm.heights == [0.9]
