"""Demonstrations held against each other, over HTTP, by the client and on the command line."""

import json

import httpx
import pytest
from typer.testing import CliRunner

from app.api.schemas.checks import TaskCheckOut
from app.cli import application
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from tests.pipeline.skill.shown import WORDS, recordings


@pytest.fixture(scope="module")
def client(url):
    with RoboPromptClient(url) as client:
        yield client


def one_is_off(number, objects, stops):
    return objects, [(p + (number == 5) * 0.06, q, o) for p, q, o in stops]


def taught(client, task, number, change=None):
    """The answers to uploads of so many recordings."""
    items = recordings(number, change=change)
    return [
        client.upload(task, WORDS, item.motion.trajectory, Observation(item.demonstration.objects)) for item in items
    ]


@pytest.fixture(scope="module")
def tidy(client):
    """The task `tidy`: eight demonstrations, one of which acts beside the objects; the answers to their uploads."""
    return taught(client, "tidy", 8, one_is_off)


def test_the_odd_one_is_named(client, tidy):
    answer = client.check("tidy")
    TaskCheckOut.model_validate(answer)
    assert not set(answer) - set(TaskCheckOut.model_fields)
    assert (answer["num_episodes"], answer["num_checked"]) == (8, 8)
    assert {finding["where"] for finding in answer["findings"]} == {f"episodes[{tidy[5]['id']}]"}
    assert tidy[-1]["findings"] == answer["findings"]
    (plan,) = answer["plans"]
    assert {row["follows"] for row in plan["rows"] if row["switches"]} == {"cup", "coaster"}
    least = {episode["id"]: episode["least_probable"]["p"] for episode in plan["episodes"]}
    assert min(least, key=least.get) == tidy[5]["id"]


def test_a_check_follows_what_is_stored(client):
    *_, second, third = (answer["findings"] for answer in taught(client, "grows", 3))
    assert [finding["code"] for finding in second] == ["few-demonstrations"]
    assert client.check("grows")["findings"] == third == []


@pytest.mark.parametrize(("task", "status", "said"), [("nothing", 404, "nothing"), ("empty", 409, "POST /episodes")])
def test_tasks_that_cannot_be_checked_are_refused_with_the_reason(client, http, task, status, said):
    http.put("/tasks/empty", json={}).raise_for_status()
    with pytest.raises(ServiceProblemError) as refused:
        client.check(task)
    assert refused.value.status == status
    assert said in str(refused.value)


def run(url, *arguments):
    return CliRunner().invoke(application, ["check", *arguments, "--url", url], env={"COLUMNS": "80"})


def test_the_command_prints_what_to_do_in_80_columns(url, tidy):
    done = run(url, "tidy")
    assert done.exit_code == 0, done.output
    assert max(map(len, done.output.splitlines())) <= 80
    assert "unusual-demonstration" in done.output
    assert tidy[5]["id"] in done.output.replace("\n", "")
    assert "opens" in done.output


def test_the_command_says_json(url, tidy):
    done = run(url, "tidy", "--json")
    assert json.loads(done.stdout) == httpx.get(f"{url}/tasks/tidy/check").json()


def test_strictness_is_an_exit_status(url, client, tidy):
    taught(client, "pair", 2)
    assert run(url, "tidy", "--strict").exit_code == 1
    assert run(url, "pair", "--strict").exit_code == 0  # an info is no failure


def test_a_task_that_is_not_there_is_an_error_of_the_command(url):
    done = run(url, "nothing")
    assert done.exit_code == 1
    assert "nothing" in done.output
