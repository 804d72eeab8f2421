"""Demonstrations that predict each other, over HTTP, by the client and on the command line."""

import json

import httpx
import pytest
from typer.testing import CliRunner

from app.api.schemas.checks import TaskCheckOut
from app.cli import application
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from tests.pipeline.check.recordings import recorded, slipped


@pytest.fixture(scope="module")
def client(url):
    with RoboPromptClient(url) as client:
        yield client


@pytest.fixture(scope="module")
def tidy(client):
    """The task `tidy`: six demonstrations, the last of another plan; their ids."""
    recordings = recorded(6)
    return [upload(client, "tidy", item) for item in [*recordings[:5], slipped(recordings[5])]]


def upload(client, task, item):
    seen = Observation(item.demonstration.objects)
    return client.upload(task, item.demonstration.instruction, item.motion.trajectory, seen)["id"]


def test_the_odd_one_is_named(client, http, tidy):
    answer = client.check("tidy")
    TaskCheckOut.model_validate(answer)
    assert not set(answer) - set(TaskCheckOut.model_fields)
    assert (answer["num_episodes"], answer["num_checked"], answer["model"]) == (6, 6, None)
    assert [finding["code"] for finding in answer["findings"]] == ["demonstration-unlike-others"]
    assert answer["unlike_episode_ids"] == tidy[-1:]
    usual, odd = answer["plans"]
    assert (usual["shown"], odd["shown"]) == (True, False)
    assert [row["objects"] for row in usual["rows"]] == [["cube"]] * 3 + [["plate"]] * 3
    assert max(row["worst_cm"] for row in usual["rows"]) < 0.1
    assert [episode["id"] for episode in usual["episodes"]] == tidy[:-1]


def test_a_model_is_asked_and_nothing_of_it_is_recorded(client, http, tidy):
    answer = client.check("tidy", "nearest")
    assert answer["model"] == "nearest"
    assert [reply["episode_id"] for reply in answer["replies"]] == tidy[:-1]
    for reply in answer["replies"]:
        assert (reply["num_actions"], reply["problem"], reply["wrong"]) == (6, None, False)
        assert max(reply["error_cm"]) < 1
    assert http.get("/tasks/tidy/stats").json()["predictions"] == 0
    assert http.get("/predictions", params={"task": "tidy"}).json()["predictions"] == []


def test_a_model_that_gives_no_actions_is_found_out(client, http, tidy):
    answer = client.check("tidy", "scripted")
    assert answer["findings"][0]["code"] == "model-mispredicts"
    assert answer["findings"][0]["severity"] == "danger"
    assert (answer["findings"][0]["wrong"], answer["findings"][0]["asked"]) == (5, 5)
    assert all(reply["num_actions"] is None and reply["problem"] for reply in answer["replies"])
    assert http.get("/predictions", params={"task": "tidy"}).json()["predictions"] == []


def test_a_check_follows_what_is_stored(client, http):
    first, second, third = recorded(3)
    upload(client, "grows", first)
    upload(client, "grows", second)
    assert [finding["code"] for finding in client.check("grows")["findings"]] == ["few-demonstrations"]
    upload(client, "grows", third)
    assert client.check("grows")["findings"] == []


@pytest.mark.parametrize(
    ("task", "model", "status", "said"),
    [("nothing", None, 404, "nothing"), ("empty", None, 409, "POST /episodes"), ("tidy", "gpt-0", 422, "gpt-0")],
)
def test_tasks_that_cannot_be_checked_are_refused_with_the_reason(client, http, tidy, task, model, status, said):
    http.put("/tasks/empty", json={}).raise_for_status()
    with pytest.raises(ServiceProblemError) as refused:
        client.check(task, model)
    assert refused.value.status == status
    assert said in str(refused.value)


def run(url, *arguments):
    return CliRunner().invoke(application, ["check", *arguments, "--url", url], env={"COLUMNS": "80"})


def test_the_command_prints_what_to_do_in_80_columns(url, tidy):
    done = run(url, "tidy")
    assert done.exit_code == 0, done.output
    assert max(map(len, done.output.splitlines())) <= 80
    assert "demonstration-unlike-others" in done.output
    assert tidy[-1] in done.output.replace("\n", "")
    assert "opens" in done.output
    assert "left out of prompts" in done.output


def test_the_command_says_json(url, tidy):
    done = run(url, "tidy", "--json")
    assert json.loads(done.stdout) == httpx.get(f"{url}/tasks/tidy/check").json()


def test_strictness_is_an_exit_status(url, client, tidy):
    for item in recorded(2):
        upload(client, "pair", item)
    assert run(url, "tidy", "--strict").exit_code == 1
    assert run(url, "pair", "--strict").exit_code == 0  # an info is no failure


def test_a_task_that_is_not_there_is_an_error_of_the_command(url):
    done = run(url, "nothing")
    assert done.exit_code == 1
    assert "nothing" in done.output
