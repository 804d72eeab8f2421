import json

import numpy as np
import pytest

from app.perception.images import ImageBytes, decode_frame
from app.perception.poses_wire import answers_from_json, poses_document, request_parts
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import ObjectPose

RANDOM = np.random.default_rng(0)
CAMERA = Camera("front", 610, 611, 3.5, 2.5, np.eye(4), 0.0005, (8, 6))


def frame(mask):
    rgb = RANDOM.integers(0, 255, (6, 8, 3), np.uint8)
    depth_m = (RANDOM.integers(0, 3000, (6, 8)) * 0.0005).astype(np.float32)
    return RgbdFrame(CAMERA, rgb, depth_m, mask)


@pytest.mark.parametrize("ids", [(0, 7, 65535), (-1, 7, 70_000)], ids=["16 bits", "32 bits"])
def test_images_arrive_as_they_were_sent(ids):
    sent = frame(RANDOM.choice(np.array(ids, np.int32), (6, 8)))
    parts = request_parts([], [sent])
    images = ImageBytes(*(parts[f"{kind}_front"][1] for kind in ("rgb", "depth", "mask")))
    received = decode_frame(CAMERA, images)
    np.testing.assert_array_equal(received.rgb, sent.rgb)
    np.testing.assert_allclose(received.depth_m, sent.depth_m, atol=1e-6)
    np.testing.assert_array_equal(received.mask, sent.mask)


def test_metadata_says_what_is_asked():
    objects = [
        {"name": "red cube", "mask_ids": [3, 4], "model": None},
        {"name": "mug", "mask_ids": [], "model": {"mesh": "mug.obj"}},
    ]
    bare = RgbdFrame(Camera("left", 600, 600, 320, 240, np.eye(4)))
    parts = request_parts(objects, [frame(None), bare])
    assert set(parts) == {"metadata", "rgb_front", "depth_front"}
    document = json.loads(parts["metadata"][1])
    assert document["objects"] == objects
    front, left = document["cameras"]
    assert front == {
        "name": "front",
        "intrinsics": {"fx": 610, "fy": 611, "cx": 3.5, "cy": 2.5, "width": 8, "height": 6},
        "camera_to_world": np.eye(4).tolist(),
        "depth_scale": 0.0005,
    }
    assert "width" not in left["intrinsics"]


def test_poses_survive_a_reply():
    turned = ObjectPose("mug", np.array([0.1, 0.2, 0.3]), np.array([0, 0, 0.6, 0.8]), "cuboid", ("front",), 0.75, "far")
    still = ObjectPose("lid", np.array([1.0, 2.0, 3.0]))
    reply = json.loads(json.dumps(poses_document([turned, still])))
    mug, lid = answers_from_json(reply, ["lid", "mug"], ["front", "left"])
    np.testing.assert_array_equal(mug.position_m, turned.position_m)
    np.testing.assert_array_equal(mug.quaternion_xyzw, turned.quaternion_xyzw)
    assert (mug.name, mug.cameras, mug.confidence, mug.reason) == ("mug", ("front",), 0.75, "far")
    assert (lid.name, lid.quaternion_xyzw, lid.cameras, lid.confidence) == ("lid", None, (), 1.0)


GOOD = {"name": "mug", "position": [0, 0, 1]}


@pytest.mark.parametrize(
    ("reply", "field"),
    [
        (None, "poses"),
        ([GOOD], "poses"),
        ({"poses": GOOD}, "poses"),
        ({"poses": []}, "poses"),
        ({"poses": ["mug"]}, "poses[0]"),
        ({"poses": [GOOD, {**GOOD, "name": "cup"}]}, "poses[1].name"),
        ({"poses": [{**GOOD, "name": ["mug"]}]}, "poses[0].name"),
        ({"poses": [{**GOOD, "position": [0, 0]}]}, "poses[0].position"),
        ({"poses": [{**GOOD, "position": [0, 0, float("inf")]}]}, "poses[0].position"),
        ({"poses": [{**GOOD, "position": ["0", "0", "1"]}]}, "poses[0].position"),
        ({"poses": [{**GOOD, "quaternion_xyzw": [0, 0, 0, 2]}]}, "poses[0].quaternion_xyzw"),
        ({"poses": [{**GOOD, "confidence": 1.1}]}, "poses[0].confidence"),
        ({"poses": [{**GOOD, "confidence": float("nan")}]}, "poses[0].confidence"),
        ({"poses": [{**GOOD, "confidence": "high"}]}, "poses[0].confidence"),
        ({"poses": [{**GOOD, "cameras": "front"}]}, "poses[0].cameras"),
        ({"poses": [{**GOOD, "cameras": ["back"]}]}, "poses[0].cameras"),
    ],
)
def test_a_reply_that_is_not_as_it_should_be(reply, field):
    with pytest.raises(InvalidInputError) as caught:
        answers_from_json(reply, ["mug"], ["front"])
    assert caught.value.field == field
