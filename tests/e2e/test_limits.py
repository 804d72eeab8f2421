"""An operator's limits hold."""

import json

import httpx
import numpy as np
import pytest

from tests.e2e.processes import killable_server
from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory, png, upload

PLACE_M = (0.1, 0.1, 0.78)
TIGHT = {
    "ROBOPROMPT_MAX_IMAGE_MEGAPIXELS": "0.002",
    "ROBOPROMPT_MAX_UNPACKED_MB": "0.005",
    "ROBOPROMPT_MAX_FRAMES": "30",
    "ROBOPROMPT_MAX_PROMPT_CHARS": "600",
    "ROBOPROMPT_MAX_BODY_MB": "0.1",
    "ROBOPROMPT_DEFAULT_MODEL": "scripted",
    "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([f"[[50, 50, {z}, 0, 36, 36, 1]]" for z in range(20, 60)]),
}


@pytest.fixture(scope="module")
def http(tmp_path_factory):
    with killable_server(tmp_path_factory.mktemp("tight"), TIGHT) as (_, url), httpx.Client(base_url=url) as client:
        assert upload(client, "pick", PLACE_M).status_code == 201
        yield client


def refused(response, field):
    problem = response.json()
    assert (response.status_code, problem["errors"][0]["field"]) == (422, field), problem
    assert "at most" in problem["detail"] or "1 to" in problem["detail"]


def send(http, document=None, trajectory=None, **images):
    whole = {**metadata("pick", {"cube": PLACE_M}), **(document or {})}
    return http.post(
        "/episodes", files=multipart(whole, trajectory or npz(**arrays(pick_trajectory(PLACE_M))), **images)
    )


def test_each_limit(http):
    long = {name: np.repeat(array, 10, axis=0) for name, array in arrays(pick_trajectory(PLACE_M)).items()}
    refused(send(http, trajectory=npz(**long)), "trajectory")
    inline = {name: np.repeat(array, 2, axis=0).tolist() for name, array in arrays(pick_trajectory(PLACE_M)).items()}
    refused(
        http.post("/episodes", json={"metadata": metadata("pick", {"cube": PLACE_M}), "trajectory": inline}),
        "trajectory",
    )
    refused(send(http, {"cameras": [camera()]}, rgb_front=png(np.zeros((48, 64, 3), np.uint8))), "rgb_front")
    refused(send(http, {"cameras": (cameras := [camera(f"c{k}") for k in range(17)])}), "cameras")
    refused(send(http, {"task": "n" * 65}), "task")
    refused(send(http, {"instruction": "pick up the cube, " * 30}), "instruction")
    many = [{"name": f"cube {k}", "position": PLACE_M} for k in range(65)]
    refused(send(http, {"objects": many}), "objects")
    refused(http.post("/predict", json={**metadata("pick", {}), "objects": many}), "objects")
    assert http.get("/episodes", params={"limit": 201}).status_code == 422
    assert http.get("/episodes").status_code == 200
    assert (
        http.post("/predict", content=b"x" * 200_000, headers={"content-type": "application/json"}).status_code == 413
    )
    seen = {"name": "cube", "mask_ids": [1]}
    refused(http.post("/poses", json={"objects": [seen], "cameras": cameras}), "cameras")


def test_a_prompt_that_is_too_long(http):
    question = {**metadata("pick", {"cube": PLACE_M}), "unsupported": "allow"}
    assert http.post("/predict", json=question).status_code == 200
    for _ in range(5):
        upload(http, "pick", PLACE_M)
    refused(http.post("/predict", json=question), "num_demonstrations")
    assert http.post("/predict", json={**question, "num_demonstrations": 1}).status_code == 200


def test_images_go_to_no_other_machine(http):
    model = {"estimator": "remote", "url": "http://169.254.169.254/latest"}
    answer = http.put("/tasks/remote", json={"object_models": {"mug": model}})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "object_models[mug].url")
    assert "ROBOPROMPT_POSE_SERVERS" in answer.json()["detail"]
    model["url"] = "http://127.0.0.1:9/poses"
    assert http.put("/tasks/remote", json={"object_models": {"mug": model}}).status_code == 200
