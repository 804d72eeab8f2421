"""Poses from images alone: found, judged, stored, drawn; and images that show nothing are refused."""

from dataclasses import replace
from itertools import cycle

import cv2
import numpy as np
import pytest

from tests.e2e.vision import (
    INSTRUCTION,
    MODELS,
    NAMES,
    PLACES,
    RED_MODEL,
    assert_found,
    episode,
    frames,
    seen,
    teach,
)
from tests.episodes import refused
from tests.perception.solid_scene import FRONT, cube

SCENE = (cube("red", 0.02, 0.05, 0.2), cube("blue", 0.12, -0.10, -0.4))


@pytest.fixture(scope="module")
def task(http):
    teach(http, "images_only")
    return "images_only"


def ask(http, task, views, **more):
    return http.post("/predict", files=seen(task, views, model="nearest", **more))


def test_objects_are_found_by_their_models(http):
    for found, solids in zip(teach(http, "found"), PLACES, strict=True):
        assert_found(found["objects"], solids)
        for item in found["objects"]:
            assert (item["estimator"], sorted(item["cameras"])) == ("cuboid", ["front", "left"])
            assert 0.5 <= item["confidence"] <= 1
        found.pop("findings")
        assert http.get(f"/episodes/{found['id']}").json() == found


def test_a_prediction_answers_and_stores_the_observed_poses(http, task):
    answer = ask(http, task, frames(SCENE)).json()
    assert_found(answer["objects"], SCENE)
    assert [item["name"] for item in answer["objects"]] == list(MODELS)
    stored = http.get(f"/predictions/{answer['id']}").json()
    assert stored["objects"] == answer["objects"]
    assert stored["cameras"] == ["front", "left"]
    assert "red cube" in answer["prompt"]["user"]
    assert len(answer["actions"]) == 3


@pytest.fixture(scope="module")
def given(http):
    """A question about a task whose poses are given; of its two episodes one has an image."""
    document = {"task": "given", "instruction": INSTRUCTION, "objects": [{"name": "mug", "position": [0, 0, 0.8]}]}
    for views in ((), frames(SCENE)):
        answer = http.post("/episodes", files=episode("given", views, objects=document["objects"]))
        assert answer.json()["objects"][0]["confidence"] == 1
    return {**document, "model": "regression"}


def test_given_poses_are_certain_and_come_without_images(http, given):
    answer = http.post("/predict", json=given).json()
    (mug,) = answer["objects"]
    assert (mug["estimator"], mug["cameras"], mug["confidence"], mug["reason"]) == ("given", [], 1, "")
    assert http.get(f"/predictions/{answer['id']}").json()["cameras"] == []


def test_models_and_given_poses_go_together(http):
    http.put("/tasks/mixed", json={"object_models": {"red cube": RED_MODEL}})
    objects = [{"name": "plate", "position": [0.3, 0.2, 0.8]}, {"name": "red cube"}]
    answer = http.post("/episodes", files=episode("mixed", frames(SCENE), objects=objects))
    assert [(item["name"], item["estimator"]) for item in answer.json()["objects"]] == [
        ("plate", "given"),
        ("red cube", "cuboid"),
    ]


def test_another_model_extracts_again(http):
    (first, *_) = teach(http, "larger", places=PLACES[:1])
    raised = {**RED_MODEL, "origin_m": [0, 0, 0.025]}
    settings = http.put("/tasks/larger", json={"object_models": {**MODELS, "red cube": raised}}).json()
    assert settings["object_models"]["red cube"]["origin_m"] == [0, 0, 0.025]
    again = http.get(f"/episodes/{first['id']}").json()["objects"][0]
    np.testing.assert_allclose(np.subtract(again["position"], first["objects"][0]["position"]), [0, 0, 0.025])


def test_a_model_of_an_object_that_the_task_does_not_have(http, task):
    answer = http.put(f"/tasks/{task}", json={"object_models": {**MODELS, "green cube": RED_MODEL}})
    assert refused(answer, "object_models[green cube]")["valid"] == "red cube, blue cube"
    http.put("/tasks/unlike", json={"object_models": MODELS})
    answer = http.post("/episodes", files=episode("unlike", frames(SCENE), objects=NAMES[:1]))
    refused(answer, "object_models[blue cube]")


def without_depth():
    front, left = frames(SCENE)
    return [replace(front, depth_m=None), left]


def without_known_depth():
    front, left = frames(SCENE)
    return [front, replace(left, depth_m=np.zeros_like(left.depth_m))]


def scaled(factor):
    """Both cameras' images with depths and depth_scale that are wrong by a factor."""
    return [
        replace(frame, depth_m=frame.depth_m * factor, camera=replace(frame.camera, depth_scale=0.001 * factor))
        for frame in frames(SCENE)
    ]


def swapped():
    front, left = frames(SCENE)
    return [replace(front, camera=replace(left.camera, name="front")), replace(left, camera=FRONT_AS_LEFT)]


FRONT_AS_LEFT = replace(FRONT, name="left")


def blue_first():
    return [replace(frame, rgb=frame.rgb[..., ::-1].copy()) for frame in frames(SCENE)]


def without_color():
    return [replace(frame, rgb=None) for frame in frames(SCENE)]


BAD = {
    "no color": (without_color, "invalid-input", "rgb_front", "is missing"),
    "no depth": (without_depth, "invalid-input", "depth_front", "is missing"),
    "all-zero depth": (without_known_depth, "invalid-input", "depth_left", "0 (unknown) everywhere"),
    "millimeters as meters": (lambda: scaled(1000), "invalid-input", "depth_front", "the scale is wrong"),
    "meters as kilometres": (lambda: scaled(0.001), "invalid-input", "depth_front", "the scale is wrong"),
    "no camera": (list, "invalid-input", "cameras", "there is none"),
    "swapped cameras": (swapped, "uncertain-pose", "objects[red cube]", "cameras front and left put it"),
    "outside the view": (
        lambda: frames((SCENE[0],)),
        "object-not-visible",
        "objects[blue cube]",
        "no pixel has its color",
    ),
    "two of one color": (
        lambda: frames((*SCENE, cube("red", -0.12, -0.02, 0.1))),
        "uncertain-pose",
        "objects[red cube]",
        "2 that look like it",
    ),
    "BGR": (blue_first, "invalid-input", "rgb_front", "red and blue exchanged"),
}


@pytest.mark.parametrize(("path", "case"), list(zip(cycle(("/episodes", "/predict")), BAD)))
def test_bad_images_are_refused_for_what_is_wrong(http, task, case, path):
    views, kind, field, said = BAD[case]
    before = stored(http, task)
    body = episode(task, views()) if path == "/episodes" else seen(task, views(), model="regression")
    response = http.post(path, files=body)
    problem = response.json()
    assert response.status_code == 422, problem
    assert response.headers["content-type"] == "application/problem+json"
    (error,) = problem["errors"]
    assert (problem["type"], error["field"]) == (f"/problems/{kind}", field), problem
    assert said in error["message"], problem
    assert error["valid"]
    assert stored(http, task) == before


def stored(http, task):
    """What a refused request must leave alone."""
    predictions = http.get("/predictions", params={"task": task}).json()["predictions"]
    return http.get(f"/tasks/{task}").json(), [item["id"] for item in predictions]


def test_an_overlay_shows_what_was_found(http, task):
    id_ = ask(http, task, frames(SCENE)).json()["id"]
    (episode_,) = http.get("/episodes", params={"task": task, "limit": 1}).json()["episodes"]
    for path in (f"/predictions/{id_}", f"/episodes/{episode_['id']}"):
        answer = http.get(f"{path}/images/front/overlay")
        assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
        drawn = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
        assert drawn.shape == (480, 640, 3)
        assert http.get(f"{path}/images/back/overlay").status_code == 404
    # the orange of the first object is nowhere in the scene itself
    assert (np.abs(drawn[..., ::-1].astype(int) - (230, 159, 0)).max(axis=2) < 12).sum() > 50
    assert http.get("/predictions/none/images/front/overlay").status_code == 404


def test_overlay_without_an_image(http, given):
    id_ = http.post("/predict", json=given).json()["id"]
    response = http.get(f"/predictions/{id_}/images/front/overlay")
    assert (response.status_code, response.json()["type"]) == (404, "/problems/not-found")
