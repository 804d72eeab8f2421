"""Recordings that contradict each other, over HTTP: no answer made of them goes without a danger."""

import httpx
import numpy as np
import pytest

from tests.e2e.processes import running_server
from tests.episodes import arrays, metadata, multipart, npz, pick_trajectory

AWAY_M = np.array([0.1, 0.15, 0.0])


@pytest.fixture(scope="module")
def http(tmp_path_factory):
    settings = {"ROBOPROMPT_WARM_UP": "false", "ROBOPROMPT_DEFAULT_MODEL": "nearest"}
    with (
        running_server(tmp_path_factory.mktemp("contradictions"), settings) as url,
        httpx.Client(base_url=url, timeout=60) as client,
    ):
        for task, num_wrong in (("right", 0), ("half", 5), ("slip", 1)):
            client.put(f"/tasks/{task}", json={"workspace": "rlbench"}).raise_for_status()
            for k in range(10):
                hand_m = np.array([0.04 * k, 0.1 * (k % 3), 0.78])
                cube_m = hand_m - AWAY_M * (k % 2 and k < 2 * num_wrong)
                files = multipart(metadata(task, {"cube": cube_m.tolist()}), npz(**arrays(pick_trajectory(hand_m))))
                client.post("/episodes", files=files).raise_for_status()
        yield client


def severities(http, task, **options):
    answer = http.post("/predict", json={**metadata(task, {"cube": (0.15, 0.05, 0.78)}), **options})
    answer.raise_for_status()
    return {finding["code"]: finding["severity"] for finding in answer.json()["findings"]}


@pytest.mark.parametrize("options", [{}, {"num_demonstrations": 1}, {"num_demonstrations": 2, "selection": "nearest"}])
def test_half_in_another_base_frame_is_a_danger_however_few_a_prompt_shows(http, options):
    assert "danger" not in severities(http, "right", **options).values()
    assert "danger" not in severities(http, "slip", **options).values()
    assert severities(http, "half", **options)["several-ways"] == "danger"


def test_a_setting_allows_several_ways(http):
    http.put("/tasks/half", json={"ways": "several"}).raise_for_status()
    assert severities(http, "half")["several-ways"] == "info"
    http.put("/tasks/half", json={"ways": "one"}).raise_for_status()
    assert severities(http, "half")["several-ways"] == "danger"


def test_naming_demonstrations_of_one_way_hides_no_other(http):
    ids = [episode["id"] for episode in http.get("/episodes?task=half&limit=20").json()["episodes"]]
    episodes = [http.get(f"/episodes/{id_}").json() for id_ in ids]
    right = [item["id"] for item in episodes if (item["objects"][0]["position"][0] + 1e-9) / 0.04 % 1 < 1e-3]
    assert len(right) == 5
    for named in (right, right[:2]):
        assert severities(http, "half", episode_ids=named)["several-ways"] == "danger"


def test_a_scene_is_held_against_all_demonstrations(http):
    far = {"objects": [{"name": "cube", "position": [0.15, 0.05, 1.3]}]}
    assert severities(http, "right", num_demonstrations=1, **far)["object-beyond-demonstrations"] == "danger"
