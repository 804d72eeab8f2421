"""Limits of motion hold as they are when an action is sent, and go only by an explicit word."""

import json
import threading
from itertools import count

import httpx
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError, ServiceProblemError
from roboprompt_client.runs.loop import run_task
from tests.e2e.processes import killable_server, llm_saying, streamed
from tests.e2e.test_safety import PICK, QUERY_M, located, teach
from tests.e2e.test_stream import Arm, seen

BOX = {"min": (QUERY_M - 0.02).tolist(), "max": (QUERY_M + 0.02).tolist()}
ROWS = [[51, 38, 27, 0, 36, 36, 1], [51, 38, 17, 0, 36, 36, 0], [51, 38, 32, 0, 36, 36, 0]]
NUMBERS = count()
OPTIONS = {"representation": "absolute", "prompt_format": "paper", "unsupported": "allow"}


class HeldLlm:
    """Says each row when the test lets it."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.go, self.asked, self.rows = threading.Semaphore(0), threading.Semaphore(0), ROWS

    def let(self, number):
        """Let it say so many rows more."""
        self.go.release(number)

    def pieces(self):
        go, asked = self.go, self.asked  # a reply that goes on after its test takes nothing from the next one's
        for k, row in enumerate(self.rows):
            asked.release()
            assert go.acquire(timeout=60)
            yield ("[" if k == 0 else ", ") + json.dumps(row) + ("]" if k == len(self.rows) - 1 else "")


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    llm = HeldLlm()
    with (
        llm_saying(llm.pieces, "held") as settings,
        killable_server(tmp_path_factory.mktemp("held"), settings) as (_, url),
    ):
        yield llm, url


@pytest.fixture
def service(held):
    """The LLM, a client, and a task of its own in a workspace whose bins the rows are written in."""
    llm, url = held
    llm.reset()
    task = f"task {next(NUMBERS)}"
    with RoboPromptClient(url) as client:
        teach(client, task)
        yield llm, client, task


def problem_of(call, *arguments, **options):
    with pytest.raises(ServiceProblemError) as caught:
        call(*arguments, **options)
    return caught.value.problem


def unsafe(problem):
    return (problem["status"], problem["type"]) == (502, "/problems/unsafe-action")


def in_background(call):
    """Runs `call`; returns a function that waits for its result or error."""
    outcome = []

    def run():
        try:
            outcome.append(call())
        except Exception as error:
            outcome.append(error)

    thread = threading.Thread(target=run)
    thread.start()

    def result():
        thread.join(60)
        (only,) = outcome
        return only

    return result


@pytest.mark.parametrize("tightened", [{"keep_out": [BOX]}, {"max_step_m": 0.05}])
def test_limits_tightened_while_the_llm_writes_count(service, tightened):
    llm, client, task = service
    answer = in_background(lambda: client.predict(task, PICK, located(), **OPTIONS))
    assert llm.asked.acquire(timeout=30)
    client.configure_task(task, motion_limits=tightened)
    llm.let(3)
    error = answer()
    assert isinstance(error, ServiceProblemError)
    assert unsafe(error.problem)
    stored = client.get(f"/predictions/{error.problem['prediction_id']}")
    assert (stored["status"], stored["actions"]) == ("unsafe_action", None)


def test_bounded_steps_that_come_while_the_llm_writes_need_a_start_too(service):
    llm, client, task = service
    answer = in_background(lambda: client.predict(task, PICK, seen(QUERY_M), **OPTIONS))
    assert llm.asked.acquire(timeout=30)
    client.configure_task(task, motion_limits={"max_step_m": 1.0})
    llm.let(3)
    assert "end_effector" in answer().problem["errors"][0]["valid"]


def test_limits_tightened_between_the_actions_of_a_stream_count(service):
    llm, client, task = service
    arrived = streamed(client.url, task, PICK, located(), **OPTIONS)
    llm.let(1)
    action = next(document for name, document in arrived if name == "action")
    assert action["position"][2] == pytest.approx(0.875)
    client.configure_task(task, motion_limits={"keep_out": [BOX]})
    llm.let(2)
    name, problem = next(arrived)
    assert name == "error"
    assert unsafe(problem)
    assert problem["errors"][0]["field"] == "actions[1].position"
    assert client.get(f"/predictions/{problem['prediction_id']}")["status"] == "unsafe_action"


def test_limits_loosened_while_the_llm_writes_count_too(service):
    llm, client, task = service
    client.configure_task(task, motion_limits={"keep_out": [BOX]})
    answer = in_background(lambda: client.predict(task, PICK, located(), **OPTIONS))
    assert llm.asked.acquire(timeout=30)
    client.configure_task(task, motion_limits={"keep_out": None})
    llm.let(3)
    assert len(answer().actions) == 3


@pytest.mark.parametrize("bound", [{"max_step_m": 1.0}, {"max_step_rotation_deg": 180}])
def test_bounded_steps_need_to_know_where_the_arm_is(service, bound):
    _, client, task = service
    client.configure_task(task, motion_limits=bound)
    problem = problem_of(client.predict, task, PICK, seen(QUERY_M), **OPTIONS)
    assert (problem["status"], problem["type"]) == (422, "/problems/invalid-input")
    (error,) = problem["errors"]
    assert error["field"] == "end_effector"
    assert next(iter(bound)) in error["message"]
    arm = Arm()
    with pytest.raises(InvalidInputError, match="end_effector"):
        run_task(client, arm, task, PICK, **OPTIONS)
    assert arm.log == ["stop"]


def test_the_page_asks_where_the_arm_is(service):
    _, client, task = service

    def field():
        return httpx.get(f"{client.url}/ui/predict", params={"task": task}).text.split('id="arm"')[1].split(">")[0]

    assert 'name="end_effector"' in field()
    assert "required" not in field()
    client.configure_task(task, motion_limits={"max_step_m": 0.5})
    assert "required" in field()
