"""What is read of an image before it is decoded is what decoders find."""

import cv2
import numpy as np
import pytest

from app.perception.images import decode_rgb, jpeg_size, num_pixels
from roboprompt_client.errors import InvalidInputError

RNG = np.random.default_rng(0)
RGB = RNG.integers(0, 256, (40, 60, 3), np.uint8)
BASELINE = cv2.imencode(".jpg", RGB)[1].tobytes()
PNG = cv2.imencode(".png", RGB)[1].tobytes()


@pytest.mark.parametrize("flags", [(), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 1)])
@pytest.mark.parametrize("seed", range(20))
def test_size_of_jpegs(flags, seed):
    image = np.random.default_rng(seed).integers(0, 256, (100 + seed, 90, 3), np.uint8)
    data = cv2.imencode(".jpg", image, flags)[1].tobytes()
    assert jpeg_size(data) == (90, 100 + seed)


def test_a_thumbnail_in_a_segment_does_not_count():
    thumbnail = cv2.imencode(".jpg", RGB[:8, :8])[1].tobytes()
    segment = b"\xff\xe1" + (len(thumbnail) + 8).to_bytes(2) + b"Exif\0\0" + thumbnail
    data = BASELINE[:2] + segment * 30 + BASELINE[2:]
    assert jpeg_size(data) == (60, 40)
    assert decode_rgb("rgb", data).shape == RGB.shape


@pytest.mark.parametrize("kind", [b"IDAT", b"PLTE", b"tEXt"])
def test_a_chunk_larger_than_its_file_is_refused_before_there_is_room_for_it(kind):
    data = PNG[:33] + b"\xff\xff\xff\xff" + kind + PNG[33:]
    with pytest.raises(InvalidInputError, match="claims more bytes than the file has"):
        decode_rgb("rgb", data)


@pytest.mark.parametrize("data", [BASELINE, PNG])
def test_pixels_are_counted_without_decoding(data):
    assert num_pixels(data) == 2400


@pytest.mark.parametrize("data", [b"", b"junk", BASELINE[:20], PNG[:20], b"\xff\xd8\xff"])
def test_what_cannot_be_decoded_has_no_pixels(data):
    assert num_pixels(data) == 0
