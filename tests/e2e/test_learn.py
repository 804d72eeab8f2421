"""Object models learned from labeled episodes, over HTTP and from the command line."""

import pytest

from app.api.schemas.objects import LearnedOut
from tests.e2e.vision import BLUE_MODEL, MODELS, NAMES, PLACES, assert_found, episode, frames, seen
from tests.episodes import upload
from tests.perception.solid_scene import cube

MASKED = [{"name": name, "mask_ids": [number]} for number, name in enumerate(MODELS, 1)]
LIGHT_GREY = cube("grey", 0.10, 0.12)


def label(http, task, objects=MASKED, places=PLACES):
    """Upload labeled episodes."""
    for solids in places:
        answer = http.post("/episodes", files=episode(task, frames(solids, masks=True), objects=objects))
        assert answer.status_code == 201, answer.text


def learn(http, task, **fields):
    return http.post(f"/tasks/{task}/object_models/learn", json=fields)


@pytest.fixture(scope="module")
def learned(http):
    label(http, "labeled")
    response = learn(http, "labeled")
    assert response.status_code == 200, response.text
    LearnedOut.model_validate_json(response.content)
    return response.json()


def test_sizes_and_colors_are_learned_from_masks(http, learned):
    assert learned["refused"] == {}
    assert len(learned["episode_ids"]) == len(PLACES)
    for model in learned["object_models"].values():
        assert model["size_m"] == pytest.approx([0.05] * 3, abs=0.002)
    assert http.get("/tasks/labeled").json()["object_models"] == learned["object_models"]


def test_stored_episodes_are_found_again_by_what_was_learned(http, learned):
    for id_, solids in zip(learned["episode_ids"], PLACES, strict=True):
        objects = http.get(f"/episodes/{id_}").json()["objects"]
        assert {item["estimator"] for item in objects} == {"cuboid"}
        assert_found(objects, solids)


def test_from_then_on_names_are_enough(http, learned):
    solids = (cube("red", 0.0, 0.0, 0.4), cube("blue", 0.1, -0.08))
    answer = http.post("/predict", files=seen("labeled", frames(solids), NAMES, dry_run=True))
    assert_found(answer.json()["objects"], solids)
    assert http.post("/episodes", files=episode("labeled", frames(solids))).status_code == 201
    assert len(learn(http, "labeled").json()["episode_ids"]) == len(PLACES)  # the new one has no labels


def test_objects_that_cannot_be_learned_are_named_and_the_rest_are_learned(http):
    objects = [*MASKED, {"name": "stone", "mask_ids": [3]}]
    label(http, "partly", objects, [(*solids, LIGHT_GREY) for solids in PLACES])
    answer = learn(http, "partly").json()
    assert list(answer["object_models"]) == list(MODELS)
    assert "have a color" in answer["refused"]["stone"]
    id_ = answer["episode_ids"][0]
    estimators = {item["name"]: item["estimator"] for item in http.get(f"/episodes/{id_}").json()["objects"]}
    assert estimators == {"red cube": "cuboid", "blue cube": "cuboid", "stone": "masks"}


def test_some_objects_only_and_others_keep_their_models(http):
    label(http, "one_of_two")
    http.put("/tasks/one_of_two", json={"object_models": {"blue cube": BLUE_MODEL}})
    before = http.get("/tasks/one_of_two").json()["object_models"]
    answer = learn(http, "one_of_two", objects=["red cube"], episodes=2).json()
    assert (list(answer["object_models"]), len(answer["episode_ids"])) == (["red cube"], 2)
    after = http.get("/tasks/one_of_two").json()["object_models"]
    assert after == {**before, **answer["object_models"]}


def test_nothing_to_learn_from(http):
    assert learn(http, "never_heard_of").status_code == 404
    http.put("/tasks/no_episodes", json={})
    assert learn(http, "no_episodes").json()["type"] == "/problems/no-demonstrations"
    upload(http, "no_images", (0.1, 0.1, 0.78))
    (error,) = learn(http, "no_images").json()["errors"]
    assert error["field"] == "episodes"
    (error,) = learn(http, "no_images", objects=["ball"]).json()["errors"]
    assert (error["field"], error["valid"]) == ("objects", "cube")
