"""Episodes and tasks over HTTP."""

import io

import cv2
import numpy as np
import pytest

from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory, png, refused, upload

PLACE_M = (0.123, 0.077, 0.785)
CUBOID = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}


def test_upload_answers_with_keyframes_bins_and_texts(http):
    http.put("/tasks/contract", json={"workspace": "rlbench"}).raise_for_status()
    response = upload(http, "contract", PLACE_M)
    episode = response.json()
    assert response.status_code == 201
    assert response.headers["location"] == f"/episodes/{episode['id']}"
    assert [keyframe["index"] for keyframe in episode["keyframes"]] == [6, 11, 20]
    assert episode["keyframes"][1]["bins"] == [42, 57, 18, 0, 36, 36, 0]
    assert episode["observation_text"] == "{'cube': [42, 57, 18], 'pick up the cube'}>"
    assert episode["actions_text"].startswith("[[42, 57, 28, 0, 36, 36, 1], [42, 57, 18, 0, 36, 36, 0]")
    assert [finding["code"] for finding in episode.pop("findings")] == ["few-demonstrations"]
    assert http.get(f"/episodes/{episode['id']}").json() == episode


def test_trajectory_comes_back_bit_for_bit(http):
    sent = arrays(pick_trajectory(PLACE_M))
    id_ = upload(http, "contract", PLACE_M).json()["id"]
    with np.load(io.BytesIO(http.get(f"/episodes/{id_}/trajectory").content)) as archive:
        for name, array in sent.items():
            np.testing.assert_array_equal(archive[name], array)


@pytest.mark.parametrize("unfilled", [(None, ""), ("", b"", "application/octet-stream")])
def test_fields_of_a_form_in_which_no_image_was_chosen_are_left_out(http, unfilled):
    document = metadata("unfilled", {"cube": PLACE_M}, cameras=[camera()])
    files = multipart(document, npz(**arrays(pick_trajectory(PLACE_M)))) | {
        "rgb_front": unfilled,
        "mask_front": unfilled,
    }
    response = http.post("/episodes", files=files)
    assert response.status_code == 201, response.text
    refused(http.post("/episodes", files=files | {"rgb_front": ("front.png", b"")}), "rgb_front")


def test_json_upload_equals_multipart(http):
    trajectory = {name: np.asarray(array, float).tolist() for name, array in arrays(pick_trajectory(PLACE_M)).items()}
    document = metadata("contract", {"cube": PLACE_M})
    by_json = http.post("/episodes", json={"metadata": document, "trajectory": trajectory}).json()
    by_multipart = upload(http, "contract", PLACE_M).json()
    differing = ("id", "created_at")
    assert {k: v for k, v in by_json.items() if k not in differing} == {
        k: v for k, v in by_multipart.items() if k not in differing
    }


def masked_episode(task, **more):
    mask = np.zeros((48, 64), np.uint16)
    mask[20:28, 30:34] = 7
    depth = np.full((48, 64), 220, np.uint16)
    document = {
        "task": task,
        "instruction": "pick up the cube",
        "objects": [{"name": "cube", "mask_ids": [7]}],
        "cameras": [camera()],
    }
    images = {"depth_front": png(depth), "mask_front": png(mask), "rgb_front": png(np.full((48, 64, 3), 9, np.uint8))}
    return multipart({**document, **more}, npz(**arrays(pick_trajectory(PLACE_M))), **images)


def test_masks_give_positions(http):
    episode = http.post("/episodes", files=masked_episode("masked")).json()
    assert http.get("/tasks/masked").json()["pose_estimator"] == "masks"
    (cube,) = episode["objects"]
    assert (cube["estimator"], cube["cameras"], cube["quaternion_xyzw"]) == ("masks", ["front"], None)
    np.testing.assert_allclose(cube["position"], [0, 0, 0.78], atol=1e-6)


def test_unseen_object_is_named(http):
    files = masked_episode("masked2", objects=[{"name": "cube", "mask_ids": [9]}])
    refused(http.post("/episodes", files=files), "objects[cube]")


def test_images_come_back(http):
    id_ = http.post("/episodes", files=masked_episode("masked")).json()["id"]
    rgb = http.get(f"/episodes/{id_}/images/front/rgb")
    depth = http.get(f"/episodes/{id_}/images/front/depth")
    assert rgb.headers["content-type"] == "image/png"
    assert (cv2.imdecode(np.frombuffer(depth.content, np.uint8), cv2.IMREAD_UNCHANGED) == 220).all()
    assert http.get(f"/episodes/{id_}/images/back/rgb").status_code == 404


def test_idempotency_key_stores_once(http):
    document = metadata("idempotent", {"cube": PLACE_M})
    body = npz(**arrays(pick_trajectory(PLACE_M)))
    headers = {"Idempotency-Key": "k-1"}
    first, second = (http.post("/episodes", files=multipart(document, body), headers=headers).json() for _ in range(2))
    assert first == second
    assert http.get("/tasks/idempotent").json()["num_episodes"] == 1
    other = metadata("idempotent", {"cube": PLACE_M}, extra={"run": 2})
    assert http.post("/episodes", files=multipart(other, body), headers=headers).status_code == 409


def test_pages_and_deletion(http):
    ids = [upload(http, "paged", PLACE_M).json()["id"] for _ in range(5)]
    page = http.get("/episodes", params={"task": "paged", "limit": 3}).json()
    rest = http.get("/episodes", params={"task": "paged", "limit": 3, "cursor": page["next_cursor"]}).json()
    assert [item["id"] for item in page["episodes"] + rest["episodes"]] == ids[::-1]
    assert rest["next_cursor"] is None
    assert http.delete(f"/episodes/{ids[0]}").status_code == 204
    assert http.get(f"/episodes/{ids[0]}").status_code == 404
    assert http.get("/tasks/paged").json()["num_episodes"] == 4


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"workspace": {"min": [0, 0, 0], "max": [0, 1, 1]}}, "workspace"),
        ({"keyframes": {"rule": "often"}}, "keyframes.rule"),
        ({"keyframes": {"delta_rad_s": -1}}, "keyframes.delta_rad_s"),
        ({"pose_estimator": "crystal_ball"}, "pose_estimator"),
        ({"yaw_symmetry_deg": {"cube": 70}}, "yaw_symmetry_deg.cube"),
        ({"color": "red"}, "color"),
        ({"motion_limits": {"max_step_m": 0}}, "motion_limits.max_step_m"),
        ({"object_models": {"red cube": {"estimator": "crystal ball"}}}, "object_models[red cube].estimator"),
        ({"object_models": {"re{d": CUBOID}}, "object_models"),
        ({"object_models": {"red cube": "red"}}, "object_models.red cube"),
    ],
)
def test_bad_settings_are_refused(http, settings, field):
    refused(http.put("/tasks/settings", json=settings), field)
    assert http.get("/tasks/settings").status_code == 404


def test_health_and_models(http):
    assert http.get("/healthz").json()["status"] == "ok"
    assert http.get("/readyz").json()["checks"] == {"store": "ok", "model": "ok"}
    models = {item["name"]: item for item in http.get("/models").json()["models"]}
    assert models["embedded/gemma-3-270m"]["available"]
    assert models["embedded/gemma-3-270m"]["default"]
    assert models["regression"]["representation"] == "absolute"
