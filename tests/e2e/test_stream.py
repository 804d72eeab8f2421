"""Actions that come while the real LLM still writes, and a robot that moves by them."""

import json
from dataclasses import replace

import httpx
import numpy as np
import pytest
from httpx_sse import connect_sse

from roboprompt_client.answers import PredictedActions
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import MotionError, NotConfirmedError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.runs.loop import run_closed_loop, run_task
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose
from tests.e2e.processes import EVENTS, answering, running_server
from tests.episodes import pick_trajectory

PLACES_M = np.random.default_rng(3).uniform([0.0, -0.3, 0.77], [0.4, 0.3, 0.79], (10, 3)).round(4)
QUERY_M = np.array([0.213, -0.117, 0.78])
INSTRUCTION = "pick up the cube"


class Arm:
    """A robot that writes down what it is to do; the cube stays in the closed gripper."""

    def __init__(self, fails_at=None):
        self.cube_m = QUERY_M.copy()
        self.log = []
        self._fails_at = fails_at
        self._is_open = True

    def observe(self):
        return Observation((ObjectPose("cube", self.cube_m.copy()),))

    def execute(self, action):
        if len(self.log) == self._fails_at:
            raise MotionError("something is in the way")
        if not self._is_open:
            self.cube_m = np.array(action.position_m)
        self._is_open = action.gripper_open
        self.log.append(action)

    def stop(self):
        self.log.append("stop")


@pytest.fixture(scope="module")
def client(url):
    with RoboPromptClient(url) as client:
        for place_m in PLACES_M:
            client.upload("stream", INSTRUCTION, tracked(pick_trajectory(place_m), place_m), seen(place_m))
        yield client


def tracked(trajectory, place_m):
    """The cube rests until the gripper has closed on it, then moves with it."""
    grasped = np.cumsum(~trajectory.gripper_open) > 1
    positions_m = np.where(grasped[:, None], trajectory.positions_m, place_m)
    return replace(trajectory, object_positions_m=positions_m[:, None])


def seen(place_m):
    return Observation((ObjectPose("cube", np.array(place_m)),))


def check(actions):
    offsets_m = [action.position_m - QUERY_M for action in actions]
    np.testing.assert_allclose(offsets_m, [[0, 0, 0.1], [0, 0, 0], [0, 0, 0.15]], atol=0.005)


def test_each_action_comes_before_the_whole_answer(client):
    client.predict("stream", INSTRUCTION, seen(QUERY_M))  # starts the model
    *actions, answer = client.stream("stream", INSTRUCTION, seen(QUERY_M))
    check(actions)
    assert isinstance(answer, PredictedActions)
    assert [a.position_m.tolist() for a in answer.actions] == [a.position_m.tolist() for a in actions]
    timings_ms = answer.response["timings_ms"]
    assert timings_ms["first_action"] < 0.9 * timings_ms["total"]


def test_events_on_the_wire(client, url):
    body = {"task": "stream", "instruction": INSTRUCTION, "objects": [{"name": "cube", "position": QUERY_M.tolist()}]}
    with (
        httpx.Client(base_url=url, timeout=60) as http,
        connect_sse(http, "POST", "/predict", json={**body, "model": "regression"}) as source,
    ):
        assert source.response.headers["content-type"].startswith("text/event-stream")
        events = [(event.event, json.loads(event.data)) for event in source.iter_sse()]
    assert [name for name, _ in events] == ["findings", "grounding"] + ["action"] * 3 + ["done"]
    assert events[-1][1]["actions"] == [document for _, document in events[2:5]]


def test_what_fails_before_the_first_action_has_its_own_status(client):
    for task, options, status in (("nothing", {}, 404), ("stream", {"model": "nobody"}, 422)):
        with pytest.raises(ServiceProblemError) as caught:
            list(client.stream(task, INSTRUCTION, seen(QUERY_M), **options))
        assert caught.value.status == status
    with pytest.raises(ServiceProblemError, match="not a list of valid actions"):
        list(client.stream("stream", INSTRUCTION, seen(QUERY_M), model="scripted"))


def test_a_robot_moves_while_the_llm_writes(client):
    arm = Arm()
    predicted = run_task(client, arm, "stream", INSTRUCTION, stream=True)
    check(arm.log)
    assert len(predicted.actions) == 3


@pytest.mark.parametrize("stream", [False, True])
def test_a_robot_that_cannot_go_on_is_stopped(client, stream):
    arm = Arm(fails_at=1)
    with pytest.raises(MotionError):
        run_task(client, arm, "stream", INSTRUCTION, stream=stream, model="regression")
    assert [isinstance(entry, EndEffectorAction) for entry in arm.log] == [True, False]
    arm = Arm()
    with pytest.raises(NotConfirmedError, match="action 2"):
        run_task(client, arm, "stream", INSTRUCTION, stream=stream, model="regression", confirm=lambda k, _: k < 1)
    assert arm.log[1:] == ["stop"]


HALF = "[[51, 38, 27, 0, 36, 36, 1], [51, 38, 17, 0, 36, 36, 0], [51, 500, 32, 0, 36, 36, 0], [51"


def test_a_reply_that_goes_wrong_in_the_middle_stops_the_robot(tmp_path):
    environment = {"ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([HALF])}
    with running_server(tmp_path, environment) as url, RoboPromptClient(url) as client:
        client.configure_task("broken", workspace="rlbench")
        client.upload("broken", INSTRUCTION, pick_trajectory(PLACES_M[0]), seen(PLACES_M[0]))
        arm = Arm()
        with pytest.raises(ServiceProblemError, match="action 2: y is 500"):
            run_task(client, arm, "broken", INSTRUCTION, stream=True, model="scripted")
        assert [isinstance(entry, EndEffectorAction) for entry in arm.log] == [True, True, False]
        (kept,) = client.get("/predictions", task="broken")["predictions"]
        assert (kept["status"], kept["actions"]) == ("parse_error", None)


def test_a_service_that_dies_in_the_middle_stops_the_robot():
    """It gives one action and is gone."""
    action = {"position": [0.1, 0.1, 0.8], "quaternion_xyzw": [1, 0, 0, 0], "gripper_open": True}
    said = f'event: findings\ndata: {{"findings": []}}\n\nevent: action\ndata: {json.dumps(action)}\n\n'
    arm = Arm()
    ended = pytest.raises(ServiceUnreachableError, match="ended before it was complete")
    with answering(lambda *_: (200, EVENTS, said)) as url, RoboPromptClient(url) as client, ended:
        run_task(client, arm, "pick", INSTRUCTION, stream=True, limits=MotionLimits())
    assert [isinstance(entry, EndEffectorAction) for entry in arm.log] == [True, False]


@pytest.mark.long
def test_closed_loop_with_the_real_llm(client):
    arm = Arm()
    steps = list(run_closed_loop(client, arm, "stream", INSTRUCTION, num_demonstrations=5))
    check(arm.log)
    assert [step.response["step"] for step in steps] == [0, 1, 2, 3]
    assert steps[-1].actions == ()
    usage = steps[-1].response["usage"]
    assert usage["cached_tokens"] > 0.9 * usage["prompt_tokens"]
