import cv2
import numpy as np
import pytest

from app.perception.images import ImageBytes, decode_frame
from roboprompt_client.camera import Camera
from roboprompt_client.errors import InvalidInputError

CAMERA = Camera("front", 60, 60, 2.5, 1.5, np.eye(4), depth_scale=0.002)
RGB = np.random.default_rng(0).integers(0, 256, (4, 6, 3), np.uint8)
DEPTH = np.full((4, 6), 500, np.uint16)
MASK = np.arange(24, dtype=np.uint16).reshape(4, 6)


def png(image):
    return cv2.imencode(".png", image)[1].tobytes()


def test_a_frame_of_all_images():
    frame = decode_frame(CAMERA, ImageBytes(png(RGB[..., ::-1]), png(DEPTH), png(MASK)))
    np.testing.assert_array_equal(frame.rgb, RGB)
    np.testing.assert_allclose(frame.depth_m, 1.0)
    np.testing.assert_array_equal(frame.mask, MASK)
    assert frame.camera is CAMERA


def test_a_frame_of_no_images():
    frame = decode_frame(CAMERA, ImageBytes())
    assert (frame.rgb, frame.depth_m, frame.mask) == (None, None, None)


@pytest.mark.parametrize(
    ("images", "field"),
    [
        (ImageBytes(rgb=b"junk"), "rgb_front"),
        (ImageBytes(depth=png(RGB)), "depth_front"),
        (ImageBytes(rgb=png(RGB), depth=png(DEPTH), mask=png(RGB)), "mask_front"),
        (ImageBytes(depth=png(DEPTH), mask=png(MASK[:2])), "depth_front"),
        (ImageBytes(depth=png(np.full((40, 60), 500, np.uint16))), "depth_front"),
    ],
)
def test_errors_name_the_part(images, field):
    with pytest.raises(InvalidInputError) as caught:
        decode_frame(CAMERA, images)
    assert caught.value.field == field
