"""What is read of an image before it is decoded is what decoders find."""

import cv2
import numpy as np
import pytest

from app.perception.images import (
    MAX_CHUNKS,
    MAX_SCANS,
    decode_depth,
    decode_rgb,
    jpeg_size,
    num_pixels,
    num_scans,
    pixels_only,
)
from roboprompt_client.errors import InvalidInputError
from tests.perception.hostile_images import START_OF_SCAN, many_scans, png_chunk, png_with

RNG = np.random.default_rng(0)
RGB = RNG.integers(0, 256, (40, 60, 3), np.uint8)
BASELINE = cv2.imencode(".jpg", RGB)[1].tobytes()
PNG = cv2.imencode(".png", RGB)[1].tobytes()


@pytest.mark.parametrize("flags", [(), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 1)])
@pytest.mark.parametrize("seed", range(20))
def test_size_and_scans_of_jpegs(flags, seed):
    image = np.random.default_rng(seed).integers(0, 256, (100 + seed, 90, 3), np.uint8)
    data = cv2.imencode(".jpg", image, flags)[1].tobytes()
    assert jpeg_size(data) == (90, 100 + seed)
    assert num_scans(data) == (10 if cv2.IMWRITE_JPEG_PROGRESSIVE in flags else 1)


def test_a_thumbnail_in_a_segment_counts_neither_as_size_nor_as_scan():
    thumbnail = cv2.imencode(".jpg", RGB[:8, :8])[1].tobytes()
    segment = b"\xff\xe1" + (len(thumbnail) + 8).to_bytes(2) + b"Exif\0\0" + thumbnail
    data = BASELINE[:2] + segment * 30 + BASELINE[2:]
    assert (jpeg_size(data), num_scans(data)) == ((60, 40), 1)
    assert decode_rgb("rgb", data).shape == RGB.shape


@pytest.mark.parametrize("number", [MAX_SCANS, MAX_SCANS + 1])
def test_scans_are_bounded(number):
    data = many_scans(64, 48, number)
    assert data.count(START_OF_SCAN) == number
    if number <= MAX_SCANS:
        assert decode_rgb("rgb", data).shape == (48, 64, 3)
    else:
        with pytest.raises(InvalidInputError, match=r"has 19 scans .*at most 18"):
            decode_rgb("rgb", data)


@pytest.mark.parametrize("kind", [b"tEXt", b"zTXt", b"iCCP", b"acTL", b"prVt"])
def test_chunks_that_pixels_do_not_need_change_nothing(kind):
    data = png_with(png_chunk(kind, b"Comment\0\0x"), 50, 60, 40)
    assert len(pixels_only(data)) == len(data) - 50 * len(png_chunk(kind, b"Comment\0\0x"))
    assert (decode_rgb("rgb", data) == 0).all()
    depth = cv2.imencode(".png", np.full((4, 6), 1500, np.uint16))[1].tobytes()
    commented = depth[:33] + png_chunk(kind, b"Comment\0\0x") + depth[33:]
    np.testing.assert_array_equal(decode_depth("depth", commented, 0.001), decode_depth("depth", depth, 0.001))


def test_a_png_of_pixels_only_is_not_copied():
    assert pixels_only(PNG) is PNG
    assert pixels_only(PNG + b"trailing") == PNG


def test_too_many_chunks_are_refused():
    data = png_with(png_chunk(b"IDAT", b""), MAX_CHUNKS)
    with pytest.raises(InvalidInputError, match="more than 100000 chunks"):
        decode_rgb("rgb", data)


@pytest.mark.parametrize("kind", [b"IDAT", b"PLTE", b"tEXt"])
def test_a_chunk_larger_than_its_file_is_refused_before_there_is_room_for_it(kind):
    data = PNG[:33] + b"\xff\xff\xff\xff" + kind + PNG[33:]
    assert pixels_only(data) is None
    with pytest.raises(InvalidInputError, match="claims more bytes than the file has"):
        decode_rgb("rgb", data)


@pytest.mark.parametrize("data", [BASELINE, PNG])
def test_pixels_are_counted_without_decoding(data):
    assert num_pixels(data) == 2400


@pytest.mark.parametrize("data", [b"", b"junk", BASELINE[:20], PNG[:20], b"\xff\xd8\xff"])
def test_what_cannot_be_decoded_has_no_pixels(data):
    assert num_pixels(data) == 0
