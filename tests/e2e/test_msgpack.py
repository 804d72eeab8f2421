"""Observations as MessagePack: the same answers as multipart. tests/attack/hostile_documents.py has what is refused."""

import msgpack
import numpy as np
import pytest

from roboprompt_client.types.camera import camera_json
from tests.api.test_packed_arrays import pack_array
from tests.e2e.vision import INSTRUCTION, NAMES, assert_found, frames, seen, teach
from tests.episodes import refused
from tests.perception.solid_scene import cube

SCENE = (cube("red", 0.02, 0.05, 0.2), cube("blue", 0.12, -0.10, -0.4))
HEADERS = {"content-type": "application/msgpack"}


@pytest.fixture(scope="module")
def task(http):
    teach(http, "packed")
    return "packed"


def document(task):
    cameras = [camera_json(frame.camera) for frame in frames(SCENE)]
    asked = {"task": task, "instruction": INSTRUCTION, "objects": NAMES, "cameras": cameras}
    return {**asked, "model": "nearest"}


def send(http, body):
    return http.post("/predict", content=body, headers=HEADERS)


def test_same_answer_as_multipart(http, task):
    images = {f"rgb_{seen.camera.name}": seen.rgb for seen in frames(SCENE)}
    images |= {f"depth_{seen.camera.name}": seen.depth_m for seen in frames(SCENE)}
    packed = send(http, msgpack.packb({**document(task), **images}, default=pack_array))
    assert packed.status_code == 200, packed.text
    assert_found(packed.json()["objects"], SCENE)
    parts = http.post("/predict", files=seen(task, frames(SCENE), model="nearest")).json()
    assert [action["bins"] for action in packed.json()["actions"]] == [action["bins"] for action in parts["actions"]]
    stored = http.get(f"/predictions/{packed.json()['id']}").json()
    assert stored["cameras"] == ["front", "left"]
    assert stored["request"]["objects"] == NAMES


# tests/attack/hostile_documents.py has more that is no MessagePack.
FAULTS = {
    "no map": (msgpack.packb([1, 2]), 400),
    "a list that claims to be long": (b"\x81\xa4task\xdd\xff\xff\xff\xff", 400),
    "deep": (b"\x81\xa4task" + b"\x91" * 100_000 + b"\x01", 400),
    "a number as key": (b"\x81\x01\x02", 400),
    "an image that is text": (msgpack.packb({"rgb_front": "file.png"}), 422),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_problems(http, fault):
    body, status = FAULTS[fault]
    response = send(http, body)
    assert (response.status_code, response.headers["content-type"]) == (status, "application/problem+json")


def test_an_array_of_another_kind_is_refused_by_what_reads_it(http, task):
    asked = {**document(task), "depth_front": np.zeros((4, 4), np.int64)}
    refused(send(http, msgpack.packb(asked, default=pack_array)), "depth_front")


def test_uploads_do_not_take_it(http):
    response = http.post("/episodes", content=msgpack.packb({}), headers=HEADERS)
    assert response.status_code == 415
