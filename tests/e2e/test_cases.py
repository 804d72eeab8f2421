"""Predictions that are kept are asked again, and what moved is said."""

import json

import httpx
import pytest
from typer.testing import CliRunner

from app.cli import application
from app.cli.check import compare
from tests.e2e.processes import running_server
from tests.episodes import metadata, upload

PLACES_M = [(0.1 + 0.05 * k, 0.02 * k, 0.78) for k in range(3)]
QUESTION = metadata("pick", {"cube": (0.15, 0.03, 0.78)}, num_demonstrations=2)


@pytest.fixture(scope="module")
def http(tmp_path_factory):
    settings = {"ROBOPROMPT_DEFAULT_MODEL": "nearest"}
    with running_server(tmp_path_factory.mktemp("cases"), settings) as url, httpx.Client(base_url=url) as client:
        for place_m in PLACES_M:
            assert upload(client, "pick", place_m).status_code == 201
        yield client


def run(http, *words):
    done = CliRunner().invoke(application, ["cases", "run", "--url", str(http.base_url), "--json", *words])
    return done.exit_code, [json.loads(line) for line in done.stdout.splitlines()]


def test_a_kept_prediction_is_asked_again(http):
    assert run(http) == (0, [])
    id_ = http.post("/predict", json=QUESTION).json()["id"]
    assert http.put(f"/predictions/{id_}/case").status_code == 204
    assert http.put(f"/predictions/{id_}/case").status_code == 204
    assert [item["id"] for item in http.get("/predictions", params={"cases": True}).json()["predictions"]] == [id_]
    assert run(http) == (0, [{"id": id_, "moved": "same"}])
    asked = http.get("/predictions", params={"limit": 1}).json()["predictions"][0]
    assert (asked["id"] != id_, asked["request"]["num_demonstrations"]) == (True, 2)
    http.put("/tasks/pick", json={"motion_limits": {"keep_out": [{"min": [0, -1, 0.7], "max": [1, 1, 0.8]}]}})
    status, (said,) = run(http, "--task", "pick")
    assert status == 1
    assert said["moved"].startswith("no actions now: ")
    assert "keep_out[0]" in said["moved"]
    assert http.delete(f"/predictions/{id_}/case").status_code == 204
    assert run(http) == (0, [])


def test_a_case_is_deleted_with_its_prediction_and_its_task(http):
    assert upload(http, "gone", PLACES_M[0]).status_code == 201
    first, second = (http.post("/predict", json={**QUESTION, "task": "gone"}).json()["id"] for _ in range(2))
    for id_ in (first, second):
        http.put(f"/predictions/{id_}/case").raise_for_status()
    assert http.delete(f"/predictions/{first}").status_code == 204
    assert http.delete("/tasks/gone").status_code == 204
    assert http.get("/predictions", params={"cases": True}).json()["predictions"] == []


def test_unknown_cases_are_refused(http):
    assert http.put("/predictions/nothing/case").status_code == 404
    assert http.delete("/predictions/nothing/case").status_code == 404


DOWN, TURNED = [1.0, 0, 0, 0], [0.9998477, 0.0174524, 0, 0]


def answer(*actions, error=None):
    listed = [{"position": [0.1, 0, z], "quaternion_xyzw": q, "gripper_open": is_open} for z, q, is_open in actions]
    return {"actions": listed or None, "error": error}


@pytest.mark.parametrize(
    ("now", "said"),
    [
        (answer((0.9, DOWN, True), (0.8, DOWN, False)), "same"),
        (answer((0.9, DOWN, True), (0.82, DOWN, False)), "moved by 2.0 cm, 0.0 degrees"),
        (answer((0.9, TURNED, True), (0.8, DOWN, False)), "moved by 0.0 cm, 2.0 degrees"),
        (answer((0.9, DOWN, True), (0.8, DOWN, True)), "the gripper of action 2"),
        (answer((0.9, DOWN, True)), "1 actions instead of 2"),
        (answer(error="no"), "no actions now: no"),
    ],
)
def test_a_comparison_names_the_change(now, said):
    before = answer((0.9, DOWN, True), (0.8, DOWN, False))
    assert compare(before, now) == said
    assert compare(answer(), answer()) == "same"
    assert compare(answer(), before) == "actions now, none before"
