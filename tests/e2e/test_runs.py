"""Robots under way: what they report and receive, over a service of two workers with keys."""

import threading
import time
from functools import partial
from uuid import uuid4

import httpx
import numpy as np
import pytest

from app.services.api_keys import create_key
from app.store import audit
from app.store.store import Store
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import MotionError, StoppedError
from roboprompt_client.robot import Observation
from roboprompt_client.runs.live import Live
from roboprompt_client.runs.loop import run_task
from roboprompt_client.types.poses import ObjectPose
from tests.e2e.processes import killable_server
from tests.episodes import refused, upload

PLACES_M = [(0.1 + 0.05 * k, 0.02 * k, 0.78) for k in range(3)]
SCOPES = {"robot": ["predict"], "rival": ["predict"], "operator": ["read", "operate"], "reader": ["read"]}
HERE = {"position": [0.1, 0.2, 0.9], "quaternion_xyzw": [1, 0, 0, 0]}
SAID = {"task": "pick", "instruction": "pick up the cube", "action": 2, "end_effector": HERE}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def people(data):
    """A client for each key."""
    store = Store.open(data)
    tokens = {name: create_key(store, name, scopes) for name, scopes in SCOPES.items()}
    tokens["admin"] = create_key(store, "admin", ["admin"])
    store.close()
    environment = {"ROBOPROMPT_DEFAULT_MODEL": "nearest", "ROBOPROMPT_AUTH": "on", "ROBOPROMPT_RATE_LIMIT_PER_S": "0"}
    with killable_server(data, environment, "--workers", "2") as (_, url):
        clients = {
            name: httpx.Client(base_url=url, headers={"Authorization": f"Bearer {token}"}, timeout=60)
            for name, token in tokens.items()
        }
        for place_m in PLACES_M:
            assert upload(clients["admin"], "pick", place_m).status_code == 201
        yield clients
        for client in clients.values():
            client.close()


@pytest.fixture
def run(people):
    """The address of a run of `robot`, which has said something."""
    address = f"/runs/{uuid4().hex}"
    assert people["robot"].put(address, json=SAID).json() == {"stop": False}
    yield address
    people["robot"].delete(address)


def test_what_a_robot_says_is_seen_until_it_ends(people, run):
    people["robot"].put(run, json={**SAID, "action": 3, "prediction_id": "p"})
    (seen,) = people["reader"].get("/runs").json()["runs"]
    assert (seen["id"], seen["task"], seen["stop"]) == (run.removeprefix("/runs/"), "pick", False)
    assert (seen["state"]["action"], seen["state"]["end_effector"]) == (3, HERE)
    assert people["rival"].get("/runs").json() == {"runs": []}
    assert people["robot"].delete(run).json() == {"stop": False}
    assert people["reader"].get("/runs").json() == {"runs": []}


def test_a_stop_reaches_the_robot_through_every_worker(people, run, data):
    assert people["operator"].post(f"{run}/stop").json()["stop"] is True
    for _ in range(6):
        assert people["robot"].put(run, json=SAID, headers={"Connection": "close"}).json() == {"stop": True}
    assert people["robot"].delete(run).json() == {"stop": True}
    assert people["operator"].post(f"{run}/stop").status_code == 404
    store = Store.open(data)
    with store.read() as connection:
        last = list(audit.entries(connection))[-1]
    store.close()
    assert (last.action, last.subject) == ("run.stopped", run.removeprefix("/runs/"))
    assert last.actor.startswith("operator")


@pytest.mark.parametrize(
    ("who", "method", "path", "status"),
    [
        ("reader", "POST", "/stop", 403),
        ("rival", "POST", "/stop", 404),
        ("rival", "PUT", "", 404),
        ("rival", "DELETE", "", 404),
        ("operator", "PUT", "", 403),
        ("operator", "DELETE", "", 403),
        ("robot", "POST", "/stop", 200),
    ],
)
def test_who_may_do_what(people, run, who, method, path, status):
    body = {"json": SAID} if method == "PUT" else {}
    assert people[who].request(method, run + path, **body).status_code == status


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"action": 0}, "action"),
        ({"action": True}, "action"),
        ({"end_effector": {"position": [0, 0], "quaternion_xyzw": [1, 0, 0, 0]}}, "end_effector.position[2]"),
        ({"joint_positions": [0.0] * 17}, "joint_positions"),
        ({"gripper_open": 1}, "gripper_open"),
        ({"task": ""}, "task"),
        ({"stop": False}, "stop"),
    ],
)
def test_impossible_reports_are_refused(people, run, change, field):
    refused(people["robot"].put(run, json=SAID | change), field)


def test_unknown_tasks_and_invalid_ids_are_refused(people):
    assert people["robot"].put(f"/runs/{uuid4().hex}", json={**SAID, "task": "nothing"}).status_code == 404
    assert people["robot"].put("/runs/mine", json=SAID).status_code == 422


def test_a_task_is_deleted_with_its_runs(people):
    assert upload(people["admin"], "gone", PLACES_M[0]).status_code == 201
    address = f"/runs/{uuid4().hex}"
    assert people["robot"].put(address, json={**SAID, "task": "gone"}).status_code == 200
    assert people["admin"].delete("/tasks/gone").status_code == 204
    assert people["robot"].delete(address).status_code == 404


class EndlessArm:
    """It moves until it is stopped, and says when that was."""

    def __init__(self):
        self.moving, self.stopped_s = threading.Event(), None

    def observe(self):
        return Observation(ObjectPose("cube", np.array(PLACES_M[1]), np.array([0, 0, 0, 1.0])))

    def execute(self, action):
        self.moving.set()
        while self.stopped_s is None:
            time.sleep(0.005)
        raise MotionError("halted")

    def stop(self):
        self.stopped_s = self.stopped_s or time.monotonic()


def test_a_stop_reaches_the_arm(people):
    arm, pressed_s = EndlessArm(), []

    def press():
        arm.moving.wait()
        (run,) = people["operator"].get("/runs").json()["runs"]
        pressed_s.append(time.monotonic())
        people["operator"].post(f"/runs/{run['id']}/stop").raise_for_status()

    person = threading.Thread(target=press)
    person.start()
    with (
        RoboPromptClient(connection=people["robot"]) as client,
        pytest.raises(StoppedError, match="a person stopped the robot"),
    ):
        run_task(client, arm, "pick", SAID["instruction"], watch=partial(Live, client, arm))
    person.join()
    assert arm.stopped_s - pressed_s[0] < 3.0  # 0.2 to 0.3 s on an idle machine
    assert people["operator"].get("/runs").json() == {"runs": []}
