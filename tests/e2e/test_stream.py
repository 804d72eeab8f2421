"""Actions that come while the real LLM still writes, and a robot that carries them out."""

import json
from dataclasses import replace

import httpx
import numpy as np
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.encoding import scene_json
from roboprompt_client.errors import MotionError
from roboprompt_client.robot import Observation
from roboprompt_client.runs.loop import run_task
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose
from tests.e2e.processes import running_server, streamed
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
    offsets_m = [np.array(action["position"]) - QUERY_M for action in actions]
    np.testing.assert_allclose(offsets_m, [[0, 0, 0.1], [0, 0, 0], [0, 0, 0.15]], atol=0.005)


def test_each_action_comes_before_the_whole_answer(client):
    client.predict("stream", INSTRUCTION, seen(QUERY_M))  # starts the model
    events = list(streamed(client.url, "stream", INSTRUCTION, seen(QUERY_M)))
    assert [name for name, _ in events] == ["findings", "grounding"] + ["action"] * 3 + ["done"]
    actions, (_, answer) = [document for _, document in events[2:5]], events[-1]
    check(actions)
    assert answer["actions"] == actions
    assert answer["timings_ms"]["first_action"] < 0.9 * answer["timings_ms"]["total"]


@pytest.mark.parametrize(("task", "options", "status"), [("nothing", {}, 404), ("stream", {"model": "nobody"}, 422)])
def test_what_fails_before_the_first_action_has_its_own_status(client, task, options, status):
    body = {"task": task, "instruction": INSTRUCTION, **scene_json(seen(QUERY_M)), **options}
    answer = httpx.post(f"{client.url}/predict", json=body, headers={"Accept": "text/event-stream"})
    assert answer.status_code == status


def test_a_robot_that_cannot_go_on_is_stopped(client):
    arm = Arm(fails_at=1)
    with pytest.raises(MotionError):
        run_task(client, arm, "stream", INSTRUCTION, model="regression")
    assert [isinstance(entry, EndEffectorAction) for entry in arm.log] == [True, False]


HALF = "[[51, 38, 27, 0, 36, 36, 1], [51, 38, 17, 0, 36, 36, 0], [51, 500, 32, 0, 36, 36, 0], [51"


def test_a_reply_that_goes_wrong_in_the_middle_ends_in_an_error(tmp_path):
    environment = {"ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([HALF])}
    with running_server(tmp_path, environment) as url, RoboPromptClient(url) as client:
        client.configure_task("broken", workspace="rlbench")
        client.upload("broken", INSTRUCTION, pick_trajectory(PLACES_M[0]), seen(PLACES_M[0]))
        events = list(streamed(url, "broken", INSTRUCTION, seen(QUERY_M), model="scripted"))
        assert [name for name, _ in events if name != "grounding"] == ["findings", "action", "action", "error"]
        assert "action 2: y is 500" in events[-1][1]["detail"]
        (kept,) = client.get("/predictions", task="broken")["predictions"]
        assert (kept["status"], kept["actions"]) == ("parse_error", None)
