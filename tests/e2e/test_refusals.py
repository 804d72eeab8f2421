"""Bad input is refused with the field and the remedy, and stores nothing."""

import json

import cv2
import numpy as np
import pytest

from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory, png, refused, upload

PLACE_M = (0.1, 0.1, 0.78)
GOOD = arrays(pick_trajectory(PLACE_M))
RGB = np.full((48, 64, 3), 128, np.uint8)


@pytest.fixture(scope="module")
def task(http):
    assert upload(http, "refusals", PLACE_M).status_code == 201
    return "refusals"


def with_array(name, value):
    return {"npz": npz(**{**GOOD, name: value})}


def changed(name, index, value):
    array = np.array(GOOD[name], float)
    array[index] = value
    return with_array(name, array)


def objects(*listed):
    return {"document": {"objects": list(listed)}}


def images(**parts):
    return {"document": {"cameras": [camera()]}, "images": parts}


# Of each kind of bad input one or two: the others are refused by the same code, which its own tests try in full.
CASES = {
    "NaN": (changed("end_effector_positions", (2, 1), np.nan), "trajectory.end_effector_positions"),
    "npz is junk": ({"npz": b"PK\x03\x04junk"}, "trajectory"),
    "robot never moves": ({"npz": npz(**{name: array[:1] for name, array in GOOD.items()})}, "trajectory"),
    "unknown camera": ({"images": {"rgb_front": png(RGB)}}, "rgb_front"),
    "corrupt image": (images(rgb_front=png(RGB)[:-30]), "rgb_front"),
    "image unlike the intrinsics": (images(rgb_front=png(np.zeros((480, 640, 3), np.uint8))), "rgb_front"),
    "image bomb": (images(rgb_front=png(np.zeros((5000, 5000), np.uint8))), "rgb_front"),
    "part of no meaning": (images(sound_front=b"x"), "sound_front"),
    "camera not rigid": (
        {"document": {"cameras": [{**camera(), "camera_to_world": (2 * np.eye(4)).tolist()}]}},
        "cameras[front].camera_to_world",
    ),
    "other objects than the task's": (
        objects({"name": "ball", "position": [0, 0, 1]}),
        "objects",
    ),
    "object twice": (objects(*[{"name": "cube", "position": [0, 0, 1]}] * 2), "objects"),
    "object without pose": (objects({"name": "cube"}), "objects[cube].position"),
    "object position NaN": (objects({"name": "cube", "position": [0, 0, float("nan")]}), "objects[0].position[2]"),
    "object name breaks the prompt": (objects({"name": "}>[[", "position": [0, 0, 1]}), "objects.name"),
    "instruction of two lines": ({"document": {"instruction": "go\nhome"}}, "instruction"),
    "first instruction of two lines": ({"document": {"uploaded_instruction": "go\nhome"}}, "uploaded_instruction"),
    "extra with NaN": ({"document": {"extra": {"score": float("nan")}}}, "extra"),
    "misspelled field": ({"document": {"instructions": "go"}}, "instructions"),
    "no instruction": ({"document": {"instruction": None}}, "instruction"),
}


@pytest.mark.parametrize("case", CASES)
def test_upload_refused(http, task, case):
    change, field = CASES[case]
    document = {**metadata(task, {"cube": PLACE_M}), **change.get("document", {})}
    body = multipart(document, change.get("npz", npz(**GOOD)), **change.get("images", {}))
    count = http.get(f"/tasks/{task}").json()["num_episodes"]
    response = http.post("/episodes", files=body)
    assert refused(response, field)["message"]
    assert http.get(f"/tasks/{task}").json()["num_episodes"] == count


def test_a_refused_first_episode_creates_no_task(http):
    document = metadata("never", {"cube": PLACE_M})
    assert http.post("/episodes", files=multipart(document, b"junk")).status_code == 422
    assert http.get("/tasks/never").status_code == 404


PREDICT = {"task": "refusals", "instruction": "pick up the cube", "objects": [{"name": "cube", "position": PLACE_M}]}


@pytest.mark.parametrize(
    ("change", "status", "said"),
    [
        ({"task": "unheard"}, 404, "unheard"),
        ({"model": "openai/none"}, 503, "ROBOPROMPT_OPENAI_API_KEY"),
        ({"model": "nobody/knows"}, 422, "embedded/gemma-3-270m"),
        ({"objects": [{"name": "ball", "position": [0, 0, 1]}]}, 422, "missing: cube"),
        ({"objects": []}, 422, "objects"),
        ({"objects": [{"name": "cube", "position": ["0.1", 0, 1]}]}, 422, "objects[0].position[0]"),
        ({"end_effector": {"position": [99, 99, 900], "quaternion_xyzw": [1, 0, 0, 0]}}, 422, "likely in millimeters"),
        ({"end_effector": {"position": [10, 10, 90], "quaternion_xyzw": [1, 0, 0, 0]}}, 422, "likely in centimeters"),
        ({"representation": "poetry"}, 422, "absolute"),
        ({"num_demonstrations": 0}, 422, "num_demonstrations"),
        ({"episode_ids": ["nothing"]}, 404, "nothing"),
        ({"timeout_s": 1e999}, 422, "timeout_s"),
        ({"unsupported": "perhaps"}, 422, "unsupported"),
        ({"after": "1"}, 422, "after"),
    ],
)
def test_predict_refused(http, task, change, status, said):
    response = http.post(
        "/predict", content=json.dumps({**PREDICT, **change}), headers={"content-type": "application/json"}
    )
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    assert said in response.text


def test_an_empty_idempotency_key_is_refused(http):
    """It would be the same key for every request of a client that has none to send."""
    refused(http.post("/episodes", json={}, headers={"Idempotency-Key": ""}), "idempotency-key")


def test_rotation_that_the_demonstrations_have_is_missing(http):
    rotated = {"name": "cube", "position": PLACE_M, "quaternion_xyzw": [0, 0, 0, 1]}
    document = {**metadata("rotated", {"cube": PLACE_M}), "objects": [rotated]}
    assert http.post("/episodes", files=multipart(document, npz(**GOOD))).status_code == 201
    asked = {**PREDICT, "task": "rotated", "model": "regression"}
    refused(http.post("/predict", json=asked), "objects[cube].quaternion_xyzw")


def test_task_without_demonstrations(http):
    assert http.put("/tasks/empty", json={}).status_code == 200
    response = http.post("/predict", json={**PREDICT, "task": "empty"})
    assert response.status_code == 409
    assert "POST /episodes" in response.json()["detail"]


@pytest.mark.parametrize("path", ["/episodes", "/predict", "/poses", "/predictions/none/outcome"])
def test_a_key_that_comes_twice_is_refused(http, path):
    content = b'{"success": true, "objects": [{"position": [0, 0, 1], "position": [0, 0, 2]}]}'
    response = http.post(path, content=content, headers={"content-type": "application/json"})
    assert (response.status_code, "'position' appears twice" in response.json()["detail"]) == (400, True)


@pytest.mark.parametrize("path", ["/episodes", "/predict"])
@pytest.mark.parametrize(
    ("content", "content_type", "status"),
    [
        (b"{not json", "application/json", 400),
        (b"[1, 2]", "application/json", 400),
        (b"[" * 100_000, "application/json", 400),
        (b"\xff\xfe\x00", "application/json", 400),
        (b"task=press", "application/x-www-form-urlencoded", 415),
        (b"", "", 415),
        (b"no boundary", "multipart/form-data", 400),
        (b"x" * 21_000_000, "application/json", 413),
    ],
)
def test_bodies_that_cannot_be_read(http, path, content, content_type, status):
    response = http.post(path, content=content, headers={"content-type": content_type})
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"


def test_settings_that_are_no_json(http):
    malformed = http.put("/tasks/none", content=b"{", headers={"content-type": "application/json"})
    assert malformed.status_code == 400
    assert malformed.json()["detail"].startswith("body is not JSON: Expecting property name")


HALF = r'"\ud800"'  # of a surrogate pair: JSON can write it, UTF-8 cannot


def test_half_characters(http, task):
    def send(method, path, content):
        return http.request(method, path, content=content, headers={"content-type": "application/json"})

    asked = json.dumps(PREDICT)[:-1]
    for field in ("episode_ids", "model", "no_such_field"):
        response = send("POST", "/predict", f'{asked}, "{field}": [{HALF}]}}')
        assert (response.status_code, response.json()["detail"][:16]) == (400, "body is not JSON")
    predicted = http.post("/predict", json={**PREDICT, "model": "nearest"}).json()["id"]
    before = http.get(f"/predictions/{predicted}").json()
    response = send("POST", f"/predictions/{predicted}/outcome", f'{{"success": true, "note": {HALF}}}')
    assert (response.status_code, response.json()["detail"][:16]) == (400, "body is not JSON")
    assert http.get(f"/predictions/{predicted}").json() == before


def test_body_without_length_is_limited_too(http):
    def chunks():
        for _ in range(30):
            yield b"x" * 1_000_000

    response = http.post("/predict", content=chunks(), headers={"content-type": "application/json"})
    assert response.status_code == 413


def test_jpeg_that_is_cut_off(http, task):
    jpeg = cv2.imencode(".jpg", RGB)[1].tobytes()[:-40]
    document = {**metadata(task, {"cube": PLACE_M}), "cameras": [camera()]}
    refused(http.post("/episodes", files=multipart(document, npz(**GOOD), rgb_front=jpeg)), "rgb_front")


def test_a_field_named_as_a_part_of_a_request_is_named_in_full(http, task):
    refused = http.put(f"/tasks/{task}", json={"aliases": {"body": 5}, "query": 1}).json()["errors"]
    assert refused == [
        {"field": "aliases.body", "message": "is 5", "valid": "a list"},
        {"field": "query", "message": "is not a known field", "valid": "the fields in /docs"},
    ]


def test_a_value_of_a_wrong_type_is_answered_with_what_is_valid(http, task):
    objects = [{"name": "red button", "position": ["a", True, None]}]
    body = {**PREDICT, "objects": objects, "seed": 1.5, "dry_run": "yes", "task": "x" * 65}
    refused = {item["field"]: item for item in http.post("/predict", json=body).json()["errors"]}
    assert {field: (item["message"], item["valid"]) for field, item in refused.items()} == {
        "task": (f"is '{'x' * 65}'", "at most 64 characters"),
        "objects[0].position[0]": ("is 'a'", "a number"),
        "objects[0].position[1]": ("is true", "a number"),
        "objects[0].position[2]": ("is null", "a number"),
        "seed": ("is 1.5", "a whole number"),
        "dry_run": ("is 'yes'", "true or false"),
    }


def test_head_is_answered_as_get_without_a_body(http):
    for path in ("/healthz", "/tasks", "/ui/tasks", "/docs"):
        head, get = http.head(path), http.get(path)
        assert (head.status_code, head.content) == (200, b""), path
        assert head.headers["content-type"] == get.headers["content-type"]
    assert http.head("/tasks/none").status_code == 404
    assert http.head("/predict").status_code == 405


def test_an_unknown_address_or_method_is_named(http):
    assert http.get("/episode").json()["detail"] == "'/episode': see /docs for the addresses"
    refused = http.delete("/predictions").json()
    assert refused["detail"] == "DELETE is not valid here; valid: GET"
    several = http.patch("/tasks/none")
    assert (several.json()["detail"], several.headers["allow"]) == (
        "PATCH is not valid here; valid: DELETE, GET, PUT",
        "DELETE, GET, PUT",
    )
