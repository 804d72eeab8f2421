"""Predictions that the service itself calls dangerous."""

import json

import httpx
import pytest
from arms import ACTIONS, WAYS, Arm, Service, client_of, closed_loop, streamed, whole

from roboprompt_client.answers import PredictedActions
from roboprompt_client.errors import DangerError, InvalidAnswerError, InvalidInputError, NotConfirmedError
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.runs.loop import run_closed_loop, run_task


def finding(severity="danger", where="objects[cube]"):
    return {"code": "object-tilted", "severity": severity, "message": "cube is tilted by 90 degrees.", "where": where}


def run(way, arm, *findings, **settings):
    actions = ACTIONS[:1] if way is closed_loop else ACTIONS
    service = Service(PredictedActions("p", actions, {"findings": list(findings)}))
    return way(service, arm, "pick", "pick up the cube", **settings)


@pytest.mark.parametrize("way", WAYS)
def test_a_danger_is_refused_without_a_person_to_ask(way):
    arm = Arm()
    with pytest.raises(DangerError, match="cube is tilted by 90 degrees"):
        run(way, arm, finding())
    assert (arm.heights, arm.stopped) == ([], 1)


@pytest.mark.parametrize("way", [whole, streamed])
def test_a_person_is_asked_before_anything_moves(way, caplog):
    asked, arm = [], Arm()

    def confirm(index, action):
        asked.append((index, len(arm.heights)))
        return True

    run(way, arm, finding(), finding("warning"), confirm=confirm)
    assert asked == [(0, 0), (0, 0), (1, 1), (2, 2)]
    assert "cube is tilted by 90 degrees" in caplog.text


def test_a_closed_loop_asks_at_every_step_that_is_dangerous():
    arm, asked = Arm(), []

    def confirm(index, action):
        asked.append((index, len(arm.heights)))
        return len(asked) < 3

    with pytest.raises(NotConfirmedError, match="cube is tilted"):
        run(closed_loop, arm, finding(), confirm=confirm, max_steps=2)
    assert asked == [(0, 0), (0, 0), (0, 1)]  # the danger, the action, and the next step's danger
    assert (len(arm.heights), arm.stopped) == (1, 1)


def test_a_no_says_what_was_dangerous_and_moves_nothing():
    arm = Arm()
    with pytest.raises(NotConfirmedError, match=r"action 2 was not allowed: cube is tilted"):
        run(whole, arm, finding(where="actions[1].position"), confirm=lambda index, action: index != 1)
    assert (arm.heights, arm.stopped) == ([], 1)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("findings", "settings"), [([finding("warning"), finding("info")], {}), ([finding()], {"on_danger": "go"})]
)
def test_other_findings_and_on_danger_go_let_it_pass(way, findings, settings):
    arm = Arm()
    run(way, arm, *findings, **settings, **({"max_steps": 3} if way is closed_loop else {}))
    assert len(arm.heights) == 3


def test_a_danger_can_be_refused_although_somebody_is_there():
    with pytest.raises(DangerError):
        run(whole, Arm(), finding(), on_danger="refuse", confirm=lambda index, action: True)


@pytest.mark.parametrize("way", [whole, closed_loop])
@pytest.mark.parametrize(("setting", "said"), [("ask", "confirm, refuse, go"), ("confirm", "no `confirm` to ask")])
def test_settings_that_cannot_be(way, setting, said):
    arm, service = Arm(), Service(PredictedActions("p", ACTIONS[:1], {"findings": []}))
    with pytest.raises(InvalidInputError, match=said):
        way(service, arm, "pick", "pick up the cube", on_danger=setting)
    assert (arm.heights, arm.stopped, service.asked) == ([], 1, 0)


def test_who_steps_through_a_closed_loop_sees_the_answer_that_is_refused():
    service = Service(PredictedActions("p", ACTIONS[:1], {"findings": [finding()]}))
    steps = run_closed_loop(service, Arm(), "pick", "pick up the cube")
    assert next(steps).findings[0]["severity"] == "danger"
    with pytest.raises(DangerError):
        next(steps)


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
ACTION = {"position": [0.1, 0.2, 0.9], "quaternion_xyzw": [1, 0, 0, 0], "gripper_open": True}
DONE = {"id": "p", "actions": [ACTION], "findings": []}


def stream_of(*events):
    """A client of a service that streams these events."""
    body = "".join(f"event: {name}\ndata: {json.dumps(document)}\n\n" for name, document in events)
    return client_of(httpx.Response(200, text=body, headers={"content-type": "text/event-stream"}))


def run_stream(arm, *events):
    return run_task(stream_of(*events), arm, "pick", "pick it up", stream=True, limits=MotionLimits())


@pytest.mark.parametrize(("response", "said"), MALFORMED)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("on_danger", [None, "go"])
def test_findings_that_are_not_well_formed_move_nothing(response, said, way, on_danger):
    arm = Arm()
    service = Service(PredictedActions("p", ACTIONS[:1], response))
    if way is streamed:
        service = stream_of(("findings", response), ("action", ACTION), ("done", DONE))
    with pytest.raises(InvalidAnswerError, match=f"the service's answer: .*{said}.*a list of objects"):
        way(service, arm, "pick", "pick it up", on_danger=on_danger, limits=MotionLimits())
    assert (arm.heights, arm.stopped) == ([], 1)


def test_a_stream_does_not_move_before_it_has_said_what_it_found():
    arm = Arm()
    with pytest.raises(InvalidAnswerError, match="did not come before the first action"):
        run_stream(arm, ("action", ACTION), ("findings", {"findings": []}), ("done", DONE))
    assert (arm.heights, arm.stopped) == ([], 1)
    run_stream(arm, ("findings", {"findings": []}), ("action", ACTION), ("done", DONE))
    assert arm.heights == [0.9]
