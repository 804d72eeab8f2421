"""One instance serves poses to another: `POST /poses` and the estimator `remote` on two real servers."""

import json

import httpx
import numpy as np
import pytest

from app.api.schemas.objects import PosesOut
from app.evaluation.server import free_port, running_server
from tests.e2e.vision import BLUE_MODEL, MODELS, NAMES, PLACES, RED_MODEL, assert_found, episode, frames, seen
from tests.perception.solid_scene import cube

SCENE = PLACES[0]
ASKED = [{"name": name, "model": model} for name, model in MODELS.items()]


@pytest.fixture(scope="module")
def pose_server(tmp_path_factory):
    """The URL of a second instance, which serves poses only."""
    with running_server(tmp_path_factory.mktemp("poses"), {"ROBOPROMPT_WARM_UP": "false"}) as address:
        yield address


def question(views, objects=ASKED):
    name, content, media_type = (parts := seen("none", views))["metadata"]
    document = {"objects": objects, "cameras": json.loads(content)["cameras"]}
    return {**parts, "metadata": (name, json.dumps(document).encode(), media_type)}


def remote(url, **settings):
    return {name: {"estimator": "remote", "url": url, "model": model, **settings} for name, model in MODELS.items()}


def refusal(response, status=422):
    problem = response.json()
    assert response.status_code == status, problem
    return problem["type"].removeprefix("/problems/"), *(problem["errors"][:1] or [problem["detail"]])


def test_poses_alone(http):
    answer = http.post("/poses", files=question(frames(SCENE)))
    assert answer.status_code == 200, answer.text
    PosesOut.model_validate_json(answer.content)
    assert_found(answer.json()["poses"], SCENE)
    assert {item["name"]: sorted(item["cameras"]) for item in answer.json()["poses"]} == {
        name: ["front", "left"] for name in MODELS
    }


def test_masks_need_no_model(http):
    objects = [{"name": "thing", "mask_ids": [2]}]
    (pose,) = http.post("/poses", files=question(frames(SCENE, masks=True), objects)).json()["poses"]
    np.testing.assert_allclose(pose["position"], SCENE[1].position_m, atol=0.03)
    assert pose["quaternion_xyzw"] is None


@pytest.mark.parametrize(
    ("objects", "field"),
    [
        ([{"name": "cube"}], "objects[cube].model"),
        ([{"name": "cube", "model": {**RED_MODEL, "size_m": 5}}], "objects[cube].model.size_m"),
        ([{"name": "cube", "model": {"estimator": "given"}}], "objects[cube].model.estimator"),
        (
            [{"name": "cube", "model": {"estimator": "remote", "url": "http://x/poses"}}],
            "objects[cube].model.estimator",
        ),
        ([{"name": "cube", "model": RED_MODEL}, {"name": "cube", "model": BLUE_MODEL}], "objects"),
        ([], "objects"),
    ],
)
def test_impossible_questions_are_refused(http, objects, field):
    _, error = refusal(http.post("/poses", files=question(frames(SCENE), objects)))
    assert error["field"] == field


def test_one_instance_asks_another(http, pose_server):
    http.put("/tasks/asked", json={"object_models": remote(f"{pose_server}/poses")})
    answer = http.post("/episodes", files=episode("asked", frames(SCENE)))
    assert answer.status_code == 201, answer.text
    assert_found(answer.json()["objects"], SCENE)
    assert {item["estimator"] for item in answer.json()["objects"]} == {"remote"}
    assert http.post("/predict", files=seen("asked", frames(SCENE), dry_run=True)).status_code == 200
    assert httpx.get(f"{pose_server}/tasks").json() == {"tasks": []}


def test_the_other_instances_refusal_comes_through(http, pose_server):
    http.put("/tasks/refused", json={"object_models": remote(f"{pose_server}/poses")})
    hidden, error = refusal(http.post("/episodes", files=episode("refused", frames(SCENE[:1]))))
    assert (hidden, error["field"]) == ("object-not-visible", "objects[blue cube]")
    assert pose_server in error["message"]
    twins = (*SCENE, cube("red", -0.12, -0.12))
    kind, error = refusal(http.post("/episodes", files=episode("refused", frames(twins))))
    assert (kind, error["field"]) == ("uncertain-pose", "objects[red cube]")
    assert http.get("/tasks/refused").json()["num_episodes"] == 0


def test_a_pose_server_that_is_not_there(http):
    url = f"http://127.0.0.1:{free_port()}/poses"
    http.put("/tasks/alone", json={"object_models": remote(url, timeout_s=0.5)})
    kind, detail = refusal(http.post("/episodes", files=episode("alone", frames(SCENE))), 503)
    assert kind == "pose-server-unavailable"
    assert url in detail
    assert http.get("/tasks/alone").json()["num_episodes"] == 0


def test_an_address_that_answers_something_else(http, pose_server):
    http.put("/tasks/wrong", json={"object_models": remote(f"{pose_server}/healthz")})
    kind, detail = refusal(http.post("/episodes", files=episode("wrong", frames(SCENE), objects=NAMES)), 502)
    assert kind == "pose-server-error"
    assert "answered HTTP 4" in detail
