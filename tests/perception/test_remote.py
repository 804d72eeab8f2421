"""The estimator `remote` against a real server that answers well, and badly in every way."""

import json
import time

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.perception.models import RemoteModel
from app.perception.remote import (
    MAX_REPLY_BYTES,
    PoseServerReplyError,
    PoseServerTimeoutError,
    PoseServerUnavailableError,
    RemotePoses,
)
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame
from tests.perception.pose_server_loopback import send, serving

TURNED = [0.0, 0.0, 0.6, 0.8]
MUG = {"name": "mug", "position": [0.1, 0.2, 0.3], "quaternion_xyzw": TURNED, "confidence": 0.9, "cameras": ["front"]}


def frame(name="front"):
    rgb = np.full((6, 8, 3), 128, np.uint8)
    return RgbdFrame(Camera(name, 600, 600, 3.5, 2.5, np.eye(4)), rgb, np.ones((6, 8), np.float32))


def replying(*poses, status=200):
    body = json.dumps({"poses": poses}).encode()
    return lambda handler, number: send(handler, status, body)


def ask(answer, *, timeout_s=5.0, frames=None, objects=None, **settings):
    """The poses, and the requests that it took."""
    with serving(answer) as (url, requests):
        queries = objects or [ObjectQuery("mug", mask_ids=(4,), model=RemoteModel(url, timeout_s, **settings))]
        return RemotePoses().estimate(queries, [frame()] if frames is None else frames), requests


def failure(answer, error, **options):
    with pytest.raises(error) as caught:
        ask(answer, **options)
    return caught.value


def test_the_servers_pose_is_taken():
    (pose,), requests = ask(replying({**MUG, "reason": "partly hidden"}), model={"mesh": "mug.obj"})
    np.testing.assert_allclose(pose.position_m, MUG["position"])
    np.testing.assert_allclose(pose.quaternion_xyzw, TURNED)
    assert (pose.name, pose.estimator, pose.cameras) == ("mug", "remote", ("front",))
    assert pose.confidence == pytest.approx(0.9)
    assert "partly hidden" in pose.reason
    headers, body = requests[0]
    assert headers["Content-Type"].startswith("multipart/form-data")
    for said in (b'"mesh": "mug.obj"', b'"mask_ids": [4]', b'name="rgb_front"', b'name="depth_front"'):
        assert said in body


def test_objects_of_one_server_are_asked_for_together_and_come_in_the_order_asked():
    def answer(handler, number):
        send(handler, 200, json.dumps({"poses": [MUG, {"name": "lid", "position": [1, 1, 1]}]}).encode())

    with serving(answer) as (url, requests), serving(replying({"name": "pan", "position": [2, 2, 2]})) as (other, _):
        models = {"lid": RemoteModel(url), "pan": RemoteModel(other), "mug": RemoteModel(url)}
        queries = [ObjectQuery(name, model=model) for name, model in models.items()]
        poses = RemotePoses().estimate(queries, [frame()])
    assert [pose.name for pose in poses] == ["lid", "pan", "mug"]
    assert poses[0].quaternion_xyzw is None
    assert poses[0].cameras == ()
    assert len(requests) == 1


def test_a_pose_for_each_camera_is_fused():
    left = {**MUG, "position": [0.104, 0.2, 0.3], "cameras": ["left"]}
    (pose,), _ = ask(replying(MUG, left), frames=[frame(), frame("left")])
    np.testing.assert_allclose(pose.position_m, [0.102, 0.2, 0.3])
    assert sorted(pose.cameras) == ["front", "left"]


def test_cameras_that_contradict_each_other_are_reported():
    left = {**MUG, "position": [0.2, 0.2, 0.3], "cameras": ["left"]}
    error = failure(replying(MUG, left), UncertainPoseError, frames=[frame(), frame("left")])
    assert error.field == "objects[mug]"
    assert "front" in error.message
    assert "left" in error.message


def test_an_object_that_is_lost_or_uncertain_is_an_error():
    lost = failure(replying({**MUG, "position": None, "reason": "behind the box"}), ObjectNotVisibleError)
    assert lost.field == "objects[mug]"
    assert "front: behind the box" in lost.message
    failure(replying({**MUG, "confidence": 0.4}), UncertainPoseError)
    assert ask(replying({**MUG, "confidence": 0.4}), min_confidence=0.3)[0][0].confidence == pytest.approx(0.4)


@pytest.mark.parametrize("status", [429, 502, 503, 504])
def test_a_busy_server_is_asked_again(status):
    def answer(handler, number):
        send(handler, status if number < 2 else 200, json.dumps({"poses": [MUG]}).encode())

    (pose,), requests = ask(answer)
    assert pose.name == "mug"
    assert len(requests) == 3
    assert requests[0][1].split(b"\r\n", 1)[1].count(b"rgb_front") == requests[2][1].count(b"rgb_front")


def test_a_broken_connection_is_tried_again():
    def answer(handler, number):
        if number == 0:
            handler.connection.close()
        else:
            send(handler, 200, json.dumps({"poses": [MUG]}).encode())

    assert len(ask(answer)[1]) == 2


def test_retry_after_is_respected():
    def answer(handler, number):
        send(handler, 200 if number else 503, json.dumps({"poses": [MUG]}).encode(), Retry_After=1)

    started = time.monotonic()
    ask(answer)
    assert time.monotonic() - started >= 1


def test_a_server_that_stays_busy_is_unavailable():
    error = failure(replying(status=503), PoseServerUnavailableError, timeout_s=0.5)
    assert "HTTP 503" in str(error)
    assert "127.0.0.1" in str(error)


def test_a_server_that_is_not_there_is_unavailable():
    with serving(replying(MUG)) as (url, _):
        pass
    with pytest.raises(PoseServerUnavailableError, match=r"127\.0\.0\.1"):
        RemotePoses().estimate([ObjectQuery("mug", model=RemoteModel(url, 0.5))], [frame()])


def test_a_server_that_does_not_answer_in_time():
    started = time.monotonic()
    error = failure(lambda handler, number: time.sleep(1), PoseServerTimeoutError, timeout_s=0.4)
    assert time.monotonic() - started < 3
    assert "0.4 s" in str(error)


def test_a_server_that_drips_does_not_outlast_the_timeout():
    def answer(handler, number):
        handler.send_response(200)
        handler.end_headers()
        for _ in range(20):
            handler.wfile.write(b" ")
            handler.wfile.flush()
            time.sleep(0.05)

    failure(answer, PoseServerTimeoutError, timeout_s=0.4)


@pytest.mark.parametrize(
    ("status", "body", "said"),
    [
        (200, b"<html>", "<html>"),
        (200, b"[" * 100_000, "[["),
        (200, b'{"poses": []}', "'mug'"),
        (200, b'{"poses": [{"name": "mug", "position": [0, 0]}]}', "poses[0].position"),
        (200, b" " * (MAX_REPLY_BYTES + 1), "more than"),
        (307, b"", "HTTP 307"),
        (401, b"who are you?", "who are you?"),
        (404, b"no such page", "no such page"),
        (500, b"CUDA out of memory", "CUDA out of memory"),
        (200, b"\x1f\x8b\xff", "HTTP 200"),
    ],
    ids=["html", "deep", "none", "half", "large", "moved", "stranger", "nowhere", "broken", "bytes"],
)
def test_a_reply_that_makes_no_sense(status, body, said):
    error = failure(lambda handler, number: send(handler, status, body), PoseServerReplyError)
    assert said in str(error)
    assert "127.0.0.1" in str(error)
    assert len(str(error)) < 800


def problem(type_, *errors):
    body = {"type": f"/problems/{type_}", "status": 422, "detail": "no", "errors": errors}
    return lambda handler, number: send(handler, 422, json.dumps(body).encode())


@pytest.mark.parametrize(
    ("type_", "kind"),
    [
        ("object-not-visible", ObjectNotVisibleError),
        ("uncertain-pose", UncertainPoseError),
        ("invalid-input", InvalidInputError),
    ],
)
def test_what_another_instance_refuses_is_refused_here(type_, kind):
    entry = {"field": "objects[mug]", "message": "too dark", "valid": "light"}
    error = failure(problem(type_, entry), InvalidInputError)
    assert type(error) is kind
    assert (error.field, error.valid) == ("objects[mug]", "light")
    assert "too dark" in error.message
    assert "127.0.0.1" in error.message


@pytest.mark.parametrize("answer", [problem("x"), problem("x", "y"), replying(status=422)])
def test_a_refusal_of_another_kind(answer):
    error = failure(answer, InvalidInputError)
    assert error.field == "cameras"
    assert "127.0.0.1" in error.message


def test_models_and_images_are_needed():
    with pytest.raises(InvalidInputError) as caught:
        RemotePoses().estimate([ObjectQuery("mug")], [frame()])
    assert caught.value.field == "object_models[mug]"
    with pytest.raises(InvalidInputError) as caught:
        RemotePoses().estimate([ObjectQuery("mug", model=RemoteModel("http://127.0.0.1:9/poses"))], [])
    assert caught.value.field == "cameras"
