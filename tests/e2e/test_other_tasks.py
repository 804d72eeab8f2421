"""A task that nobody has shown, over HTTP: the embedded LLM reads the demonstrations of another."""

import numpy as np
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import RoboPromptError, ServiceProblemError
from roboprompt_client.loop import run_task
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import ObjectPose
from tests.episodes import metadata, pick_trajectory, upload

PLACES_M = [(0.1, 0.2, 0.78), (0.25, -0.1, 0.78), (0.3, 0.05, 0.78)]
MUG_M = (0.2, -0.2, 0.8)
FETCH = metadata("fetch", {"mug": MUG_M}, instruction="hoist the mug")


@pytest.fixture(scope="module")
def taught(http):
    for place_m in PLACES_M:
        assert upload(http, "lift", place_m).status_code == 201
    http.put("/tasks/fetch", json={}).raise_for_status()
    return http


def ask(http, **options):
    return http.post("/predict", json={**FETCH, "demonstrations_from": ["lift"], **options})


def test_the_embedded_llm_carries_rows_over_to_another_object(taught):
    answer = ask(taught).json()
    offsets_m = [np.array(action["position"]) - MUG_M for action in answer["actions"]]
    np.testing.assert_allclose(offsets_m, [[0, 0, 0.1], [0, 0, 0], [0, 0, 0.15]], atol=0.005)
    assert [action["anchor"] for action in answer["actions"]] == [None] * 3
    assert answer["model"] == "embedded/gemma-3-270m"
    assert len(answer["demonstration_ids"]) == 3
    assert answer["prompt"]["user"].endswith("; hoist the mug >")
    assert answer["canonical_instruction"] == "hoist the mug"
    stored = taught.get(f"/predictions/{answer['id']}").json()
    for found in (answer["findings"], stored["findings"]):
        assert [(item["code"], item["severity"]) for item in found] == [("other-tasks-demonstrations", "danger")]
    assert stored["request"]["demonstrations_from"] == ["lift"]
    assert stored["prompt"] == answer["prompt"]


def test_a_chat_models_prompt_is_the_papers(taught):
    prompt = ask(taught, dry_run=True, representation="absolute", system_prompt="a").json()["prompt"]
    assert prompt["user"].count("'pick up the cube'}>[[") == 3
    assert prompt["user"].endswith("'hoist the mug'}>")


def test_the_stream_warns_before_the_first_action(taught):
    with taught.stream(
        "POST",
        "/predict",
        json={**FETCH, "demonstrations_from": ["lift"], "model": "nearest"},
        headers={"accept": "text/event-stream"},
    ) as stream:
        text = stream.read().decode()
    assert text.startswith("event: findings")
    assert text.index("other-tasks-demonstrations") < text.index("event: action")
    assert "event: done" in text


def test_the_robots_loop_does_not_move_for_it(taught, url):
    class Arm:
        moved = 0

        def observe(self):
            return Observation((ObjectPose("mug", np.array(MUG_M)),))

        def execute(self, action):
            self.moved += 1

        def stop(self):
            """Stands still anyway."""

    arm = Arm()
    with RoboPromptClient(url) as client, pytest.raises(RoboPromptError, match="Nobody has shown this task"):
        run_task(client, arm, "fetch", "hoist the mug", demonstrations_from=["lift"], model="nearest")
    assert arm.moved == 0


@pytest.mark.parametrize(
    ("options", "field", "valid"),
    [
        ({"demonstrations_from": ["no such task"]}, "demonstrations_from[0]", "tasks with episodes: "),
        ({"demonstrations_from": ["fetch"]}, "demonstrations_from[0]", "other tasks"),
        ({"demonstrations_from": ["lift", "lift"]}, "demonstrations_from[1]", "different names"),
        ({"demonstrations_from": ["lift"] * 9}, "demonstrations_from", "1 to 8"),
        ({"demonstrations_from": []}, "demonstrations_from", "1 to 8"),
        ({"demonstrations_from": "lift"}, "demonstrations_from", '"similar"'),
        ({"demonstrations_from": 7}, "demonstrations_from", '"similar"'),
        ({"demonstrations_from": ["{x}"]}, "demonstrations_from[0]", "letters"),
        ({"demonstrations_from": [["lift"]]}, "demonstrations_from[0]", "names"),
        ({"episode_ids": ["some"]}, "episode_ids", "one of the two"),
        ({"selection": "nearest"}, "selection", "diverse"),
        ({"closed_loop": True}, "closed_loop", "demonstrations_from"),
        ({"instruction": "pick up the cube"}, "instruction", "mug"),
    ],
)
def test_what_does_not_go_is_a_problem_that_names_the_field(taught, options, field, valid):
    response = ask(taught, model="nearest", **options)
    assert response.status_code == 422, response.text
    (entry,) = response.json()["errors"]
    assert entry["field"] == field
    assert valid in entry["valid"]


def test_the_pages_show_it_and_ask_for_it_again(taught):
    id_ = ask(taught, model="nearest").json()["id"]
    shown = taught.get(f"/ui/predictions/{id_}", headers={"accept": "text/html"})
    assert shown.status_code == 200
    assert "Nobody has shown this task" in shown.text
    again = taught.get("/ui/predict", params={"again": id_}, headers={"accept": "text/html"})
    assert '<input id="others" name="demonstrations_from" value="lift"' in again.text
    prompt = taught.post("/ui/predict/prompt", json={**FETCH, "demonstrations_from": ["lift"], "model": "nearest"})
    assert prompt.status_code == 200, prompt.text
    assert "hoist the mug" in prompt.json()["html"]
    assert taught.get("/tasks/fetch/stats").json()["configurations"][0]["selection"] == "other tasks"


def test_an_empty_task_stays_without_an_answer_otherwise(taught):
    assert taught.post("/predict", json=FETCH).status_code == 409
    assert ask(taught, task="never heard of").status_code == 404


def test_the_client_asks_for_similar_tasks(taught, url):
    with RoboPromptClient(url) as client:
        seen = Observation((ObjectPose("teapot", np.array(MUG_M)),))
        client.upload("tea", "pick up the teapot", pick_trajectory(MUG_M), seen)
        # Whatever other tests have taught this service, it lies inside.
        client.configure_task("tea again", workspace={"min": [-9, -9, -9], "max": [9, 9, 9]})
        asked = ("tea again", "pick up the teapot", seen)
        answer = client.predict(*asked, demonstrations_from="similar", model="nearest")
        shown = {client.get(f"/episodes/{id_}")["task"] for id_ in answer.response["demonstration_ids"]}
        assert "tea" in shown
        with pytest.raises(ServiceProblemError, match="demonstrations_from"):
            client.predict(*asked, demonstrations_from="alike")
