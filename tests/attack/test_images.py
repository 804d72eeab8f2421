"""Small images that take long to decode, or much memory."""

import socket
import time
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import urlsplit

import httpx
import msgpack
import numpy as np
import pytest

from app.perception.images import MAX_SCANS
from tests.attack import payloads
from tests.attack.conftest import FULL
from tests.attack.watch import cpu_s, watched
from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory

SIDE = 4000  # 16 megapixels, the most that an image may have
MAX_CPU_S = 1.0
MAX_GROWTH_MB = 100
MSGPACK = {"content-type": "application/msgpack"}
PLACE_M = (0.1, 0.1, 0.78)


def asked(http, path, number, data, width, height):
    """The answer to a request with the same image from so many cameras."""
    document, parts = payloads.with_cameras(number, data, width, height)
    if path == "/episodes":
        document = {**metadata("pick", {"cube": PLACE_M}), "cameras": document["cameras"]}
        return http.post(path, files=multipart(document, npz(**arrays(pick_trajectory(PLACE_M)))) | parts)
    if path == "/poses":
        document = {"objects": [{"name": "cube", "mask_ids": [1]}], "cameras": document["cameras"]}
    return http.post(path, files=multipart(document, None) | parts)


@pytest.mark.parametrize("path", ["/predict", "/episodes", "/poses"])
@pytest.mark.parametrize("scans", [400, 2000 if FULL else 401])
def test_jpegs_of_many_scans(service, http, path, scans):
    data = payloads.many_scans(SIDE, SIDE, scans)
    assert len(data) < 150_000
    with watched(service.process_id, service.url) as toll:
        answer = asked(http, path, 1, data, SIDE, SIDE)
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "rgb_c0"), answer.text
    assert f"{scans} scans" in answer.json()["detail"]
    assert toll.cpu_s < MAX_CPU_S, toll


def test_progressive_jpegs_as_cameras_write_them_pass(http):
    data = payloads.many_scans(640, 480, MAX_SCANS)
    assert asked(http, "/predict", 1, data, 640, 480).status_code == 200


@pytest.mark.parametrize("path", ["/predict", "/episodes", "/poses"])
def test_many_large_images(service, http, path):
    with watched(service.process_id, service.url) as toll:
        answer = asked(http, path, 16, payloads.flat_jpeg(SIDE, SIDE), SIDE, SIDE)
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "images"), answer.text
    assert "at most 64000000" in answer.json()["detail"]
    assert toll.cpu_s < MAX_CPU_S, toll
    assert toll.grown_mb < MAX_GROWTH_MB, toll


def test_many_large_arrays(service, http):
    names = [f"c{k}" for k in range(5)]
    mask = {"__ndarray__": True, "dtype": "|u1", "shape": [SIDE, SIDE], "data": bytes(SIDE * SIDE)}
    document = {**payloads.QUESTION, "cameras": [camera(name, SIDE, SIDE) for name in names]}
    body = msgpack.packb({**document, **{f"mask_{name}": mask for name in names}})
    answer = http.post("/predict", content=body, headers=MSGPACK)
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "images"), answer.text


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (payloads.png_with(payloads.text_bomb(7_900_000), 300), 200),
        (payloads.png_with(payloads.png_chunk(b"iCCP", b"x\0\0" + payloads.text_bomb(7_900_000)[17:-4]), 300), 200),
        (payloads.png_with(payloads.png_chunk(b"abCd", b""), 1_000_000), 422),
        (b"\xff\xd8\xff" + b"\xff\xd0" * 5_000_000 + b"\xff\xd9", 422),
        (b"\xff\xd8\xff" + b"\xff\xd8" * 5_000_000 + b"\xff\xd9", 422),
        (b"\xff\xd8\xff" + b"\xff\xe0\0\x02" * 2_500_000 + b"\xff\xd9", 422),
    ],
    ids=["texts", "profiles", "chunks", "restarts", "beginnings", "segments"],
)
def test_padding_within_an_image_costs_little(service, http, data, status):
    with watched(service.process_id, service.url) as toll:
        answer = asked(http, "/predict", 1, data, 64, 48)
    assert answer.status_code == status, answer.text
    assert toll.cpu_s < MAX_CPU_S, toll
    assert toll.grown_mb < MAX_GROWTH_MB, toll


def test_nothing_is_decoded_for_clients_that_have_left(service, http):
    """Four images of 16 megapixels are 1.3 s of work; who sends them and hangs up gets little of it done."""
    document, parts = payloads.with_cameras(4, payloads.flat_jpeg(SIDE, SIDE), SIDE, SIDE)
    request = http.build_request("POST", "/predict", files=multipart(document, None) | parts)
    raw = head_of(request) + request.read()
    before = cpu_s(service.process_id)
    assert http.send(request).status_code == 200
    whole_s = cpu_s(service.process_id) - before
    place = urlsplit(service.url)
    before = cpu_s(service.process_id)
    for _ in range(8):
        with socket.create_connection((place.hostname, place.port)) as connection:
            connection.sendall(raw)
    wait_until_idle(service.process_id)
    assert cpu_s(service.process_id) - before < 4 * whole_s


def head_of(request):
    fields = [f"{name}: {value}" for name, value in request.headers.items()]
    return "\r\n".join([f"{request.method} {request.url.path} HTTP/1.1", *fields, "", ""]).encode()


def wait_until_idle(process_id):
    last_s = -1.0
    while (now_s := cpu_s(process_id)) - last_s > 0.05:
        last_s = now_s
        time.sleep(1)


def test_many_at_once_leave_room_for_others(service, http):
    """Twelve requests of 64 megapixels each would take 2.4 GB together."""
    document, parts = payloads.with_cameras(4, payloads.flat_jpeg(SIDE, SIDE), SIDE, SIDE)
    number = 12 if FULL else 4

    def ask(_):
        return httpx.post(f"{service.url}/predict", files=multipart(document, None) | parts, timeout=120).status_code

    with watched(service.process_id, service.url) as toll, ThreadPoolExecutor(number) as pool:
        answers = set(pool.map(ask, range(number)))
    assert answers <= {200, 503}
    assert toll.grown_mb < 700, toll
    assert np.median(toll.health_s) < 0.5, toll
