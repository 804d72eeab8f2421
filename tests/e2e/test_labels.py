"""An object is clicked on, learned and found, over HTTP."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.api.schemas.objects import LabelList, LabelOut, LabelPreviewOut, LearnedLabelsOut, TriedModelOut
from roboprompt_client.encoding import request_parts
from roboprompt_client.types.camera import camera_json
from synthetic.object_scenes import Layout, Room, upright
from tests.e2e.vision import episode, seen
from tests.episodes import refused

PLACES = (((0.1, 0.0, 0.4), (-0.12, 0.08)), ((-0.05, -0.1, 1.4), (0.15, 0.1)), ((0.0, 0.1, -0.8), (0.15, -0.1)))
ROOM = Room(names=("carton", "jar"))
GIVEN = [{"name": "carton", "position": [0, 0, 0.05]}, {"name": "jar", "position": [0, 0, 0.05]}]
NAMES = [{"name": "carton"}, {"name": "jar"}]


def layout(carton, jar, second_jar=None):
    poses = {} if carton is None else {("carton", 0): upright(*carton)}
    poses |= {("jar", number): upright(*at, 0) for number, at in enumerate((jar, second_jar)) if at is not None}
    return Layout(poses)


def shots(where, seed=0):
    return tuple(replace(frame, mask=None) for frame in ROOM.frames(where, np.random.default_rng(seed)))


def click_on(views, place_m):
    """Pixel of the camera `front` that shows a place."""
    pixels, _ = views[0].camera.project([place_m])
    return {"front": pixels[0].round().tolist()}


@pytest.fixture(scope="module")
def labeled(http):
    """Three episodes with given poses; the carton is labeled in the stored ones, the jar in images of their own."""
    for number, (carton, jar) in enumerate(PLACES):
        views = shots(layout(carton, jar), number)
        answer = http.post("/episodes", files=episode("shelf", views, objects=GIVEN))
        assert answer.status_code == 201, answer.text
        click = click_on(views, (*carton[:2], 0.09))
        body = {"object": "carton", "episode_id": answer.json()["id"], "clicks": click}
        label = http.post("/tasks/shelf/labels", json=body)
        assert label.status_code == 201, label.text
        LabelOut.model_validate_json(label.content)
    cameras = [camera_json(frame.camera) for frame in views]
    own = {"object": "jar", "cameras": cameras, "clicks": click_on(views, (*PLACES[-1][1], 0.1))}
    assert http.post("/tasks/shelf/labels", files=request_parts(own, views)).status_code == 201
    return http


@pytest.fixture(scope="module")
def learned(labeled):
    """Both objects, at once: neither may lose the other's model."""

    def learn(name, symmetric):
        body = {"object": name, "symmetric": symmetric}
        return labeled.post("/tasks/shelf/labels/learn", json=body)

    with ThreadPoolExecutor() as pool:
        answers = list(pool.map(learn, ("carton", "jar"), ("none", "yaw")))
    assert [answer.status_code for answer in answers] == [200, 200], [answer.text for answer in answers]
    assert set(labeled.get("/tasks/shelf").json()["object_models"]) == {"carton", "jar"}
    for answer in answers:
        LearnedLabelsOut.model_validate_json(answer.content)
    return [answer.json() for answer in answers]


def ask(http, where, seed=9):
    return http.post("/predict", files=seen("shelf", shots(where, seed), NAMES, dry_run=True))


def test_one_click_labels_every_camera(labeled):
    listed = labeled.get("/tasks/shelf/labels", params={"object": "carton"})
    LabelList.model_validate_json(listed.content)
    for label in listed.json()["labels"]:
        assert [camera["name"] for camera in label["cameras"]] == ["front", "left", "right"]
        assert min(camera["num_pixels"] for camera in label["cameras"]) > 1000


def test_a_preview_shows_the_masks_and_stores_nothing(labeled):
    carton, jar = PLACES[0]
    views = shots(layout(carton, jar))
    id_ = labeled.get("/episodes", params={"task": "shelf"}).json()["episodes"][-1]["id"]
    on, off = click_on(views, (*carton[:2], 0.09))["front"], click_on(views, (*jar, 0.1))["front"]
    arrow = [on, click_on(views, (carton[0] + 0.1, carton[1], 0.11))["front"]]
    before = labeled.get("/tasks/shelf/labels").json()
    marks = {"clicks": {"front": [on, off]}, "arrows": {"front": arrow}}
    pixels = {}
    for name, more in (("both", {}), ("one", {"clicks_off": {"front": [off]}, "clicks": {"front": on}})):
        body = {"object": "carton", "episode_id": id_, **marks, **more}
        answer = labeled.post("/tasks/shelf/labels/preview", json=body)
        assert answer.status_code == 200, answer.text
        shown = LabelPreviewOut.model_validate_json(answer.content)
        assert [camera.name for camera in shown.cameras] == ["front", "left", "right"]
        assert all(camera.outlines for camera in shown.cameras)
        assert abs(shown.yaw_deg) < 15
        pixels[name] = [camera.num_pixels for camera in shown.cameras]
    assert all(both > 1.2 * one > 0 for both, one in zip(pixels["both"], pixels["one"], strict=True))
    cameras = [camera_json(frame.camera) for frame in views]
    own = {"object": "jar", "cameras": cameras, "clicks": {"front": off}}
    answer = labeled.post("/tasks/shelf/labels/preview", files=request_parts(own, views))
    assert answer.status_code == 200, answer.text
    assert labeled.get("/tasks/shelf/labels").json() == before


def test_a_dry_run_changes_nothing_and_its_model_can_be_tried(labeled):
    before = labeled.get("/tasks/shelf").json()
    body = {"object": "carton", "dry_run": True}
    answer = labeled.post("/tasks/shelf/labels/learn", json=body)
    assert answer.status_code == 200, answer.text
    model = answer.json()["model"]
    ids = [item["id"] for item in labeled.get("/episodes", params={"task": "shelf"}).json()["episodes"]]
    tried = labeled.post(
        "/tasks/shelf/object_models/try", json={"object": "carton", "model": model, "episode_ids": ids}
    )
    assert tried.status_code == 200, tried.text
    found = TriedModelOut.model_validate_json(tried.content).episodes
    assert [item.episode_id for item in found] == ids
    for item, (carton, _) in zip(found, PLACES[::-1], strict=True):
        np.testing.assert_allclose(item.pose.position[:2], carton[:2], atol=0.006)
    other = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "cyan"}
    tried = labeled.post(
        "/tasks/shelf/object_models/try", json={"object": "carton", "model": other, "episode_ids": ids[:1]}
    )
    assert tried.json()["episodes"][0]["pose"] is None
    assert "has its color" in tried.json()["episodes"][0]["refusal"]["message"]
    assert labeled.get("/tasks/shelf").json() == before


@pytest.mark.parametrize(
    ("change", "status", "field"),
    [
        ({"model": {"estimator": "nose"}}, 422, "model.estimator"),
        ({"model": {"estimator": "registered", "template": "0" * 64}}, 422, "object_models[carton].template"),
        ({"episode_ids": ["none"]}, 404, None),
        ({"episode_ids": []}, 422, "episode_ids"),
    ],
)
def test_a_model_that_cannot_be_tried_is_refused_by_name(labeled, change, status, field):
    id_ = labeled.get("/episodes", params={"task": "shelf"}).json()["episodes"][0]["id"]
    model = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}
    body = {"object": "carton", "model": model, "episode_ids": [id_], **change}
    answer = labeled.post("/tasks/shelf/object_models/try", json=body)
    assert answer.status_code == status, answer.text
    assert field is None or answer.json()["errors"][0]["field"] == field


def test_what_was_learned_says_which_views_it_has(labeled, learned):
    carton, jar = learned
    assert len(carton["model"]["views"]) == 3
    assert min(carton["model"]["scores"]) > 0.8
    assert carton["advice"] == ""
    assert "three to rely on" in jar["advice"]
    models = labeled.get("/tasks/shelf").json()["object_models"]
    assert models == {"carton": carton["model"], "jar": jar["model"]}


def test_the_objects_are_found_in_images_without_a_pose(labeled, learned):
    poses = {}
    for yaw in (0.0, 0.7):
        answer = ask(labeled, layout((0.05, -0.02, yaw), (-0.1, -0.1)))
        assert answer.status_code == 200, answer.text
        poses[yaw], jar = answer.json()["objects"]
        np.testing.assert_allclose(poses[yaw]["position"][:2], (0.05, -0.02), atol=0.006)
        np.testing.assert_allclose(jar["position"][:2], (-0.1, -0.1), atol=0.006)
        assert (jar["estimator"], jar["cameras"]) == ("registered", ["front", "left", "right"])
    before, after = (Rotation.from_quat(item["quaternion_xyzw"]) for item in poses.values())
    assert np.degrees((before.inv() * after).magnitude()) == pytest.approx(np.degrees(0.7), abs=3)


def test_a_question_for_poses_alone_may_name_a_learned_model(labeled, learned):
    """As `roboprompt-robot look` asks."""
    carton, _ = learned
    views = shots(layout((0.05, -0.02, 0.0), (-0.1, -0.1)), 9)
    for model, status in ((carton["model"], 200), ({**carton["model"], "template": "0" * 64}, 422)):
        asked = {"objects": [{"name": "carton", "model": model}], "cameras": [camera_json(v.camera) for v in views]}
        answer = labeled.post("/poses", files=request_parts(asked, views))
        assert answer.status_code == status, answer.text
        if status == 200:
            (pose,) = answer.json()["poses"]
            np.testing.assert_allclose(pose["position"][:2], (0.05, -0.02), atol=0.006)


def test_an_upload_needs_names_only(labeled, learned):
    views = shots(layout((0.1, 0.1, 0.2), (-0.1, 0.0)), 5)
    answer = labeled.post("/episodes", files=episode("shelf", views, objects=NAMES))
    assert answer.status_code == 201, answer.text
    assert {item["estimator"] for item in answer.json()["objects"]} == {"registered"}
    labeled.delete(f"/episodes/{answer.json()['id']}")


@pytest.mark.parametrize(
    ("where", "field", "words"),
    [
        (layout(None, (-0.1, -0.1)), "objects[carton]", "at least"),
        (layout((0.05, -0.02, 0.3), (-0.1, -0.1), (0.15, 0.12)), "objects[jar]", "two places look like it"),
    ],
)
def test_an_absent_object_and_two_alike_are_refused(labeled, learned, where, field, words):
    answer = ask(labeled, where)
    refused(answer, field, words)


def test_masks_and_polygons_label_as_well(labeled):
    carton, jar = PLACES[0]
    frames = ROOM.frames(layout(carton, jar), np.random.default_rng(0), of=("jar", 0))
    id_ = labeled.get("/episodes", params={"task": "shelf"}).json()["episodes"][-1]["id"]
    png = cv2.imencode(".png", frames[1].mask.astype(np.uint8))[1].tobytes()
    rows, columns = np.nonzero(frames[0].mask)
    left, top, right, bottom = (float(item) for item in (columns.min(), rows.min(), columns.max(), rows.max()))
    corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
    body = {"object": "jar", "episode_id": id_, "polygons": {"front": corners}, "yaw_deg": 10}
    answer = labeled.post("/tasks/shelf/labels", files=request_parts(body, ()) | {"mask_left": ("m.png", png)})
    assert answer.status_code == 201, answer.text
    cameras = {item["name"]: item["num_pixels"] for item in answer.json()["cameras"]}
    assert cameras["left"] == np.count_nonzero(frames[1].mask)
    assert cameras["front"] >= np.count_nonzero(frames[0].mask)
    assert labeled.delete(f"/tasks/shelf/labels/{answer.json()['id']}").status_code == 204
    assert labeled.delete(f"/tasks/shelf/labels/{answer.json()['id']}").status_code == 404


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        ({"clicks": {"front": [2, 400]}}, "clicks[front]", "no object stands out there"),
        ({"clicks": {"front": [2000, 4]}}, "clicks[front]", "is [2000.0, 4.0]"),
        ({"clicks": {"back": [5, 5]}}, "clicks[back]", "no camera"),
        ({"boxes": {"front": [2, 2, 9, 9]}}, "boxes[front]", "nothing stands"),
        ({"boxes": {"back": [2, 2, 9, 9]}}, "boxes[back]", "no camera"),
        (
            {"polygons": {"front": [[0, 0], [9, 0], [9, 9]]}, "yaw_deg": 1, "arrows": {"front": [[1, 1], [2, 2]]}},
            "arrows",
            "once",
        ),
        ({"polygons": {"front": [[0, 0], [5, 5]]}}, "polygons[front]", "2 corners"),
        ({"object": "spoon", "clicks": {"front": [5, 5]}}, "object", "'spoon'"),
        ({"object": "jar"}, "object", "in no mask"),
    ],
)
def test_a_label_without_a_mask_is_refused_by_name(labeled, change, field, words):
    id_ = labeled.get("/episodes", params={"task": "shelf"}).json()["episodes"][-1]["id"]
    answer = labeled.post("/tasks/shelf/labels", json={"object": "carton", "episode_id": id_, **change})
    refused(answer, field, words)


def test_teaching_an_object_without_labels_is_refused(labeled):
    answer = labeled.post("/tasks/shelf/labels/learn", json={"object": "spoon"})
    assert answer.status_code == 422
    assert "has no labels" in answer.text


def test_a_template_that_is_not_stored_is_refused(http):
    model = {"estimator": "registered", "template": "0" * 64}
    http.put("/tasks/strange", json={"object_models": {"carton": model}})
    views = shots(layout((0.05, 0, 0), None))
    answer = http.post("/episodes", files=episode("strange", views, objects=[{"name": "carton"}]))
    refused(answer, "object_models[carton].template")
