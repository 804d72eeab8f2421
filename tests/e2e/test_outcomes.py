"""Outcomes of predictions over HTTP: what follows from one, and how they sum up."""

import json

import httpx
import numpy as np
import pytest

from tests.e2e.processes import running_server
from tests.episodes import arrays, metadata, multipart, npz, pick_trajectory, refused, upload

ONE = "[[50, 40, 20, 36, 36, 36, 1]]"


@pytest.fixture(scope="module")
def http(tmp_path_factory):
    settings = {"ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([ONE]), "ROBOPROMPT_WARM_UP": "false"}
    with (
        running_server(tmp_path_factory.mktemp("outcomes"), settings) as url,
        httpx.Client(base_url=url, timeout=60) as client,
    ):
        client.put("/tasks/pick", json={"workspace": "rlbench"}).raise_for_status()
        for x_m in (0.0, 0.1, 0.3, 0.31):
            assert upload(client, "pick", (x_m, 0.0, 0.78)).status_code == 201
        yield client


def ask(http, **options):
    fields = {"model": "scripted", "representation": "absolute", "unsupported": "allow", **options}
    return http.post("/predict", json={**metadata("pick", {"cube": (0.2, 0.0, 0.78)}), **fields})


def linked(http, prediction_id, task="pick", link="prediction_id"):
    document = metadata(task, {"cube": (0.2, 0.0, 0.78)}, **{link: prediction_id})
    return http.post("/episodes", files=multipart(document, npz(**arrays(pick_trajectory((0.2, 0.0, 0.78))))))


def test_an_executed_prediction_becomes_a_demonstration(http):
    prediction = ask(http).json()["id"]
    http.post(f"/predictions/{prediction}/outcome", json={"success": True})
    episode = linked(http, prediction)
    assert episode.status_code == 201
    stored = http.get(f"/episodes/{episode.json()['id']}").json()
    assert stored["prediction_id"] == prediction


def test_a_demonstration_corrects_a_failed_prediction(http):
    prediction = ask(http).json()["id"]
    http.post(f"/predictions/{prediction}/outcome", json={"success": False})
    episode = linked(http, prediction, link="corrects").json()["id"]
    assert http.get(f"/episodes/{episode}").json()["corrects"] == prediction
    assert f'/ui/predictions/{prediction}">prediction {prediction[:8]}' in http.get(f"/ui/episodes/{episode}").text
    assert f'/ui/episodes/{episode}">episode {episode[:8]}' in http.get(f"/ui/predictions/{prediction}").text


@pytest.mark.parametrize("link", ["prediction_id", "corrects"])
@pytest.mark.parametrize("fault", ["unknown", "of the other outcome", "of another task"])
def test_links_that_cannot_be_are_refused(http, fault, link):
    prediction = "0" * 32 if fault == "unknown" else ask(http).json()["id"]
    if fault == "of the other outcome":
        http.post(f"/predictions/{prediction}/outcome", json={"success": link == "corrects"})
    refused(linked(http, prediction, "press" if fault == "of another task" else "pick", link), link)
    assert "press" not in [task["name"] for task in http.get("/tasks").json()["tasks"]]


def test_stats_by_configuration(http):
    for x_m, y_m in ((0.1, 0.0), (0.3, 0.1), (0.2, -0.2)):
        assert upload(http, "counted", (x_m, y_m, 0.78)).status_code == 201
    fields = {**metadata("counted", {"cube": (0.2, 0.0, 0.78)}), "model": "regression"}
    outcomes = [("first", True), ("first", True), ("first", False), ("recent", True), ("recent", None)]
    for selection, success in outcomes:
        id_ = http.post("/predict", json={**fields, "selection": selection}).json()["id"]
        if success is not None:
            http.post(f"/predictions/{id_}/outcome", json={"success": success})
    stats = http.get("/tasks/counted/stats").json()
    assert (stats["predictions"], stats["successes"], stats["failures"], stats["success_rate"]) == (5, 3, 1, 0.75)
    by_selection = {item["selection"]: item for item in stats["configurations"]}
    assert by_selection["first"]["success_rate"] == pytest.approx(2 / 3)
    # Wilson at 2 of 3
    np.testing.assert_allclose(by_selection["first"]["interval"], [0.2077, 0.9385], atol=1e-3)
    assert (by_selection["recent"]["predictions"], by_selection["recent"]["success_rate"]) == (2, 1.0)
    assert {item["model"] for item in stats["configurations"]} == {"regression"}
    assert all(item["is_yardstick"] for item in stats["configurations"])


def test_stats_without_predictions_and_of_an_unknown_task(http):
    assert http.get("/tasks/nothing/stats").status_code == 404
    assert upload(http, "fresh", (0.1, 0.0, 0.78)).status_code == 201
    stats = http.get("/tasks/fresh/stats").json()
    assert (stats["predictions"], stats["configurations"]) == (0, [])
    assert (stats["success_rate"], stats["interval"]) == (None, [0, 1])
