"""Small documents that become many objects, and large ones. What they cost is measured on the attacked service."""

import json
import struct

import msgpack
import numpy as np
import pytest

from app.api.middleware import MAX_UPLOAD_VALUES
from app.api.problems import MAX_ERRORS
from tests.attack import payloads
from tests.attack.conftest import FULL
from tests.attack.watch import watched
from tests.episodes import arrays, metadata, multipart, pick_trajectory, upload

JSON, MSGPACK = {"content-type": "application/json"}, {"content-type": "application/msgpack"}
# A machine that others use lets health checks wait, too; what stopped them before took 0.3 s and more of CPU time.
MAX_CPU_S = 1.0
MAX_GROWTH_MB = 100
SIZE = 1 if FULL else 4
PLACE_M = (0.1, 0.1, 0.78)
FLOODS = {
    "lists in MessagePack": ("/predict", payloads.packed_lists(4096 // SIZE), MSGPACK, 413),
    "lists": ("/predict", payloads.json_lists(5_000_000 // SIZE), JSON, 413),
    "lists in a task": ("/tasks/pick", payloads.json_lists(330_000), JSON, 413),
    "lists in an upload": ("/episodes", payloads.json_lists(5_000_000 // SIZE), JSON, 413),
    "keys": ("/predict", payloads.json_keys(68_000), JSON, 413),
    "keys in a task": ("/tasks/pick", payloads.json_keys(50_000), JSON, 413),
    "fewer keys": ("/predict", payloads.json_keys(9_000), JSON, 422),
    "fewer keys in a task": ("/tasks/pick", payloads.json_keys(9_000), JSON, 422),
    "levels": ("/predict", payloads.json_depth(100_000), JSON, 400),
    "levels in a task": ("/tasks/pick", payloads.json_depth(65), JSON, 400),
    "quotes": ("/predict", b'{"a": "' + b'\\"' * 400_000 + b'"}', JSON, 422),
    "lists in UTF-16": ("/tasks/pick", payloads.json_in_utf16(50_000), JSON, 400),
    "a long key before many": ("/predict", json.dumps({"a" * 900_000: [[]] * 9_000}).encode(), JSON, 422),
    "a long key in MessagePack": (
        "/predict",
        msgpack.packb({**payloads.QUESTION, "a" * 900_000: [[[]] * 4000] * 2}),
        MSGPACK,
        422,
    ),
    "a long text": ("/predict", json.dumps({**payloads.QUESTION, "task": "a" * 5_000_000}).encode(), JSON, 413),
    "a long number": ("/predict", payloads.json_number(5000), JSON, 400),
    "a number that is shown": ("/predict", payloads.json_number(4200), JSON, 422),
    "a document beside its images": (
        "/predict",
        msgpack.packb({**payloads.QUESTION, "rgb_front": b"", "task": "a" * 2_000_000}),
        MSGPACK,
        413,
    ),
}


@pytest.mark.parametrize("name", FLOODS)
def test_a_flood_of_values(service, http, name):
    path, body, headers, status = FLOODS[name]
    method = "PUT" if path.startswith("/tasks") else "POST"
    with watched(service.process_id, service.url) as toll:
        answer = http.request(method, path, content=body, headers=headers)
    assert answer.status_code == status, answer.text[:500]
    assert len(answer.content) < 20_000
    assert len(answer.json()["errors"]) <= MAX_ERRORS
    assert toll.cpu_s < MAX_CPU_S, toll
    assert toll.grown_mb < MAX_GROWTH_MB, toll
    assert http.post("/predict", json=payloads.QUESTION).status_code == 200


def test_errors_are_counted_and_the_first_are_listed(http):
    problem = http.post("/predict", content=payloads.json_keys(1000), headers=JSON).json()
    assert len(problem["errors"]) == MAX_ERRORS
    assert problem["detail"].startswith(f"the first {MAX_ERRORS} of 1000 errors: unknown0: ")
    long = http.post("/predict", json={**payloads.QUESTION, "k" * 500_000: 1, "seed": "s" * 400_000})
    assert len(long.content) < 3000
    assert long.json()["errors"][1]["field"].startswith("kkk")


def test_lists_that_only_claim_to_be_long(service, http):
    """MessagePack's lists are made as long as they claim to be: each of these five bytes asks for 32 kB."""
    nested = (b"\xdd" + struct.pack(">I", 4096)) * 100_000
    with watched(service.process_id, service.url) as toll:
        answer = http.post("/predict", content=b"\x81\xa1a" + nested, headers=MSGPACK)
    assert answer.status_code == 400
    assert toll.grown_mb < MAX_GROWTH_MB, toll


def test_a_metadata_part_is_counted_as_well(service, http):
    document = json.dumps({**payloads.QUESTION, "episode_ids": [[]] * 300_000})
    with watched(service.process_id, service.url) as toll:
        answer = http.post("/predict", files={"metadata": ("m.json", document, "application/json")})
    assert answer.status_code == 413
    assert toll.cpu_s < MAX_CPU_S, toll


def test_what_robots_send_fits(http):
    """The longest trajectory that JSON takes, and images in base64 and MessagePack beyond a document's megabyte."""
    recorded = arrays(pick_trajectory(PLACE_M))
    repeats = MAX_UPLOAD_VALUES // 20 // len(recorded["gripper_open"])
    long = {name: np.repeat(array, repeats, axis=0).tolist() for name, array in recorded.items()}
    answer = http.post("/episodes", json={"metadata": metadata("long", {"cube": PLACE_M}), "trajectory": long})
    assert answer.status_code == 201, answer.text[:500]
    assert answer.json()["num_frames"] > 10_000
    noise = np.random.default_rng(0).integers(0, 255, (1000, 1000, 3), np.uint8)
    document, parts = payloads.with_cameras(1, payloads.jpeg(noise), 1000, 1000)
    ((name, data),) = parts.items()
    assert len(data[1]) > 1_000_000
    inline = payloads.in_base64(document, {name: data[1]})
    assert http.post("/predict", content=inline, headers=JSON).status_code == 200
    packed = msgpack.packb({**document, name: data[1]})
    assert http.post("/predict", content=packed, headers=MSGPACK).status_code == 200


@pytest.mark.parametrize("spoilt", ["====", "A===", "AAA=AAAA", "AA==" * 300_000, "\n" * 100, "é" * 100])
def test_invalid_base64_is_refused(http, spoilt):
    answer = http.post("/predict", json={**payloads.QUESTION, "rgb_front": spoilt})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "rgb_front")


def test_archives_of_many_members(service, http):
    document = metadata("pick", {"cube": PLACE_M})
    for archive in (payloads.zip_of_many(100_000), payloads.zip_of_one_many_times(2000, 40_000_000)):
        with watched(service.process_id, service.url) as toll:
            answer = http.post("/episodes", files=multipart(document, archive))
        assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "trajectory")
        assert toll.cpu_s < MAX_CPU_S, toll


def test_extra_is_short_and_in_no_list(http):
    fits, large = {"note": "a" * 60_000}, {"note": "a" * 70_000}
    refused = upload(http, "noted", PLACE_M, extra=large)
    assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "extra")
    stored = upload(http, "noted", PLACE_M, extra=fits).json()
    assert stored["extra"] == http.get(f"/episodes/{stored['id']}").json()["extra"] == fits
    listed = http.get("/episodes", params={"task": "noted"})
    assert len(listed.content) < 10_000
    assert "extra" not in listed.json()["episodes"][0]
    assert http.get(f"/episodes/{stored['id']}/metadata").json()["extra"] == fits
