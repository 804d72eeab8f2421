"""Demonstrations with given poses are asked with images, and the other way round."""

import numpy as np
import pytest

from tests.e2e.vision import INSTRUCTION, MODELS, NAMES, PLACES, episode, frames, seen
from tests.episodes import arrays, metadata, multipart, npz, pick_trajectory

CODE = "uncertain-pose"
SHIFT_M = np.array([0.0, 0.03, 0.0])  # another point of the object


def given(solids, shift_m=(0, 0, 0)):
    """The objects with the poses that the solids have, as another system would know them."""
    return [
        {
            **name,
            "position": (np.array(solid.position_m) + shift_m).tolist(),
            "quaternion_xyzw": list(solid.quaternion_xyzw),
        }
        for name, solid in zip(NAMES, solids, strict=True)
    ]


def poses_by_name(solids):
    return {item["name"]: item["position"] for item in given(solids)}


def taught_without_images(http, task, models=MODELS):
    for solids in PLACES:
        document = metadata(task, poses_by_name(solids), instruction=INSTRUCTION)
        files = multipart(document, npz(**arrays(pick_trajectory(solids[0].position_m))))
        answer = http.post("/episodes", files=files)
        assert answer.status_code == 201, answer.text
    return http.put(f"/tasks/{task}", json={"object_models": models})


def sources(answer):
    assert answer.status_code == 200, answer.text
    return [(item["severity"], item["where"]) for item in answer.json()["findings"] if item["code"] == CODE]


def ask(http, task, **how):
    parts = {"objects": NAMES, **how}
    return http.post("/predict", files=seen(task, frames(PLACES[1]), dry_run=True, **parts))


@pytest.fixture(scope="module")
def given_first(http):
    """A task that was taught with given poses alone, then given object models."""
    return taught_without_images(http, "given first")


def test_models_of_a_task_without_images_apply_to_predictions_alone_with_a_note(http, given_first):
    assert given_first.status_code == 200, given_first.text
    assert "3 of 3 episodes have no images" in given_first.json()["note"]
    assert http.get("/tasks/given first").json()["note"] == given_first.json()["note"]
    listed = http.get("/episodes", params={"task": "given first"}).json()["episodes"]
    assert {item["estimator"] for one in listed for item in one["objects"]} == {"given"}
    assert taught_without_images(http, "never seen", {}).json()["note"] == ""


def test_it_can_be_asked_with_images_with_a_danger_until_both_are_compared(http, given_first):
    answer = ask(http, "given first")
    assert sources(answer) == [("danger", "objects[red cube]")]
    assert [item["estimator"] for item in answer.json()["objects"]] == ["cuboid", "cuboid"]
    shown = PLACES[1]
    both = http.post("/episodes", files=episode("given first", frames(shown), shown[0].position_m, given(shown)))
    assert both.status_code == 201, both.text
    assert [item["estimator"] for item in both.json()["objects"]] == ["cuboid", "cuboid"]
    assert sources(ask(http, "given first")) == []
    http.delete(f"/episodes/{both.json()['id']}")


@pytest.fixture(scope="module")
def images_first(http):
    """A task that was taught with images alone."""
    http.put("/tasks/images first", json={"object_models": MODELS}).raise_for_status()
    for solids in PLACES:
        answer = http.post("/episodes", files=episode("images first", frames(solids), solids[0].position_m))
        assert answer.status_code == 201, answer.text
    return answer.json()


def test_of_a_request_with_both_the_given_pose_counts(http, images_first):
    objects = given(PLACES[1], SHIFT_M)
    answer = ask(http, "images first", objects=objects)
    assert sources(answer) == [("warning", "objects[red cube]")]
    found = answer.json()["objects"]
    assert [item["estimator"] for item in found] == ["given", "given"]
    np.testing.assert_allclose(found[0]["position"], objects[0]["position"])
    one = [objects[0], NAMES[1]]
    assert [item["estimator"] for item in ask(http, "images first", objects=one).json()["objects"]] == [
        "given",
        "cuboid",
    ]
