import struct
import zlib

import cv2
import numpy as np
import pytest

from app.perception.images import (
    MAX_PIXELS,
    ImageBytes,
    as_image,
    decode_depth,
    decode_frame,
    decode_mask,
    decode_rgb,
)
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera
from tests.npy_files import HOSTILE, npy

RGB = np.random.default_rng(0).integers(0, 256, (40, 60, 3), np.uint8)
SMOOTH = np.add.outer(np.arange(40), np.arange(60))[..., None].astype(np.uint8) + np.array([0, 60, 120], np.uint8)
MASK = np.arange(2400, dtype=np.int32).reshape(40, 60)
DEPTH_MM = (MASK * 3).astype(np.uint16)


def png_chunk(kind, data):
    """A PNG's chunk."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def encoded(kind, image, *flags):
    """A PNG or JPEG of an image, red first."""
    return cv2.imencode(kind, image[..., ::-1] if image.ndim == 3 else image, flags)[1].tobytes()


def rgb(data):
    return decode_rgb("rgb_front", data)


def depth(data, depth_scale=0.001):
    return decode_depth("depth_front", data, depth_scale)


def mask(data):
    return decode_mask("mask_front", data)


@pytest.mark.parametrize("data", [encoded(".png", RGB), npy(RGB), npy(np.asfortranarray(RGB))])
def test_rgb_comes_red_first(data):
    np.testing.assert_array_equal(rgb(data), RGB)
    assert rgb(data).flags.c_contiguous


@pytest.mark.parametrize("flags", [(), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 2)])
def test_jpeg_comes_red_first(flags):
    seen = rgb(encoded(".jpg", SMOOTH, *flags))
    assert seen.dtype == np.uint8
    assert np.abs(seen.astype(int) - SMOOTH).max() <= 8


def test_16_bit_depth_has_the_cameras_scale():
    seen = depth(encoded(".png", DEPTH_MM), 0.00025)
    assert seen.dtype == np.float32
    np.testing.assert_allclose(seen, DEPTH_MM * 0.00025, rtol=1e-6)


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64, ">f4"])
def test_depth_arrays_are_meters_and_unknown_where_not_finite(kind):
    meters = np.array([[0.5, np.nan], [np.inf, 0]], kind)
    seen = depth(npy(meters), 0.00025)
    np.testing.assert_array_equal(seen, [[0.5, 0], [0, 0]])
    assert seen.dtype == np.float32


@pytest.mark.parametrize(
    "data",
    [
        encoded(".png", MASK.astype(np.uint16)),
        *(npy(MASK.astype(kind)) for kind in (np.int16, np.uint32, np.int64, np.uint64)),
    ],
)
def test_masks_keep_their_ids(data):
    np.testing.assert_array_equal(mask(data), MASK)
    assert mask(data).dtype == np.int32


def test_8_bit_and_boolean_masks():
    np.testing.assert_array_equal(mask(encoded(".png", MASK.astype(np.uint8))), MASK % 256)
    np.testing.assert_array_equal(mask(npy(MASK > 7)), MASK > 7)


@pytest.mark.parametrize("number", [2**31, 2**32 + 98, -(2**31) - 1])
def test_an_id_that_would_become_another_is_refused(number):
    with pytest.raises(InvalidInputError, match=f"has the id {number}"):
        mask(npy(np.array([[1, number]])))


@pytest.mark.parametrize(
    ("decode", "array", "message"),
    [
        (rgb, RGB[..., 0], "array (40, 60) uint8"),
        (rgb, RGB[..., :2], "array (40, 60, 2) uint8"),
        (rgb, RGB.astype(np.float32), "array (40, 60, 3) float32"),
        (rgb, RGB[None], "array (1, 40, 60, 3) uint8"),
        (depth, DEPTH_MM, "array (40, 60) uint16"),
        (depth, RGB.astype(np.float32), "array (40, 60, 3) float32"),
        (depth, np.array([[0.5, -0.1]]), "has a depth of -0.1 m"),
        (depth, np.array([[0.5, -np.inf]]), "has a depth of -inf m"),
        (mask, MASK.astype(np.float32), "array (40, 60) float32"),
        (mask, MASK.ravel(), "array (2400,) int32"),
        (mask, np.array([["a"]]), "array (1, 1) <U1"),
        (mask, np.zeros((0, 60), np.int32), "claims 0 pixels"),
        (mask, np.zeros((4001, 4000), np.uint8), "claims 16004000 pixels"),
    ],
)
def test_arrays_of_the_wrong_kind_are_refused(decode, array, message):
    with pytest.raises(InvalidInputError) as caught:
        decode(npy(array))
    assert message in caught.value.message


@pytest.mark.parametrize(
    ("decode", "image"),
    [
        (depth, encoded(".png", MASK.astype(np.uint8))),
        (depth, encoded(".png", RGB)),
        (depth, encoded(".jpg", RGB)),
        (mask, encoded(".png", RGB)),
    ],
)
def test_images_of_the_wrong_kind_are_refused(decode, image):
    with pytest.raises(InvalidInputError, match=r"is an (image|array) \(40, 60(, 3)?\) uint8"):
        decode(image)


PNG, JPEG = encoded(".png", RGB), encoded(".jpg", RGB)
FLIPPED = PNG[:1000] + bytes([PNG[1000] ^ 0xFF]) + PNG[1001:]


@pytest.mark.parametrize("decode", [rgb, depth, mask])
@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty"),
        (b"junk", "begins with b'junk'"),
        (b"GIF89a", "begins with"),
        (b"BM" + b"\0" * 100, "begins with"),
        *((PNG[:length], f"cut off after {length} bytes") for length in (8, 20, 1000, len(PNG) - 1)),
        *((JPEG[:length], f"cut off after {length} bytes") for length in (3, 200, len(JPEG) - 1)),
        (JPEG[:2] + b"\xff\xe1\x00\x04\xff\xd9" + JPEG[2:2000], "cut off"),  # an end of its thumbnail only
        (PNG[:20] + PNG[-12:], "claims"),
        (PNG[:1000] + PNG[-12:], "is damaged"),
        (FLIPPED, "is damaged"),
        (JPEG[:4] + b"\xff\xd9", "claims 0 pixels"),
        (b"\xff\xd8\xff" + b"\xff" * 1000 + b"\xff\xd9", "claims 0 pixels"),
        *HOSTILE.items(),
    ],
    ids=lambda value: str(value)[:40],
)
def test_damaged_and_hostile_files_are_refused_by_name(decode, data, message):
    with pytest.raises(InvalidInputError) as caught:
        decode(data)
    assert caught.value.field == f"{decode.__name__}_front"
    assert message in caught.value.message


def black_png(width, height):
    """A valid PNG, one bit a pixel."""
    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    rows = zlib.compress(bytes((1 + (width + 7) // 8) * height), 1)
    chunks = png_chunk(b"IHDR", header) + png_chunk(b"IDAT", rows) + png_chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunks


def jpeg_that_claims(width, height):
    """A JPEG whose frame header was overwritten, behind a comment that looks like another one."""
    start = JPEG.index(b"\xff\xc0")
    size = struct.pack(">HH", height, width)
    decoy = b"\xff\xfe\x00\x0b\xff\xc0\x00\x11\x08\x00\x01\x00\x01"
    return JPEG[:2] + decoy + JPEG[2 : start + 5] + size + JPEG[start + 9 :]


@pytest.mark.parametrize("make", [black_png, jpeg_that_claims])
@pytest.mark.parametrize("decode", [rgb, mask])
def test_a_bomb_is_refused_by_its_header(make, decode):
    bomb = make(20_000, 20_000)
    assert len(bomb) < 1_000_000
    with pytest.raises(InvalidInputError, match="claims 400000000 pixels"):
        decode(bomb)


def test_the_limit_itself_is_no_bomb():
    assert rgb(black_png(4000, MAX_PIXELS // 4000)).shape == (4000, 4000, 3)
    assert rgb(jpeg_that_claims(60, 40)).shape == (40, 60, 3)


def test_stored_images_become_what_a_browser_shows():
    assert as_image(PNG, "rgb", 0.001) == (PNG, "image/png")
    assert as_image(JPEG, "rgb", 0.001) == (JPEG, "image/jpeg")
    data, media_type = as_image(npy(RGB), "rgb", 0.001)
    np.testing.assert_array_equal(rgb(data), RGB)
    assert media_type == "image/png"
    data, _ = as_image(npy(np.array([[0.5, np.nan], [1e6, 0.25]])), "depth", 0.001)
    shown = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(shown, [[500, 0], [65535, 250]])


def test_a_header_does_not_turn_the_picture():
    """Orientation 6 of EXIF: shown after a quarter turn."""
    image = np.zeros((8, 16, 3), np.uint8)
    image[:, 8:] = 255
    jpeg_bytes = cv2.imencode(".jpg", image)[1].tobytes()
    orientation = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    segment = b"\xff\xe1" + (len(orientation) + 2).to_bytes(2) + orientation
    turned = jpeg_bytes[:2] + segment + jpeg_bytes[2:]
    assert cv2.imdecode(np.frombuffer(turned, np.uint8), cv2.IMREAD_COLOR).shape == (16, 8, 3)
    assert (decode_rgb("rgb_c", turned) == decode_rgb("rgb_c", jpeg_bytes)).all()


CAMERA = Camera("front", 60, 60, 29.5, 19.5, np.eye(4), depth_scale=0.002)
RGB_PNG, DEPTH_PNG, MASK_PNG = (encoded(".png", image) for image in (RGB, DEPTH_MM, MASK.astype(np.uint16)))


def test_a_frame_has_the_images_that_there_are():
    frame = decode_frame(CAMERA, ImageBytes(RGB_PNG, DEPTH_PNG, MASK_PNG))
    np.testing.assert_array_equal(frame.rgb, RGB)
    np.testing.assert_allclose(frame.depth_m, DEPTH_MM * 0.002, rtol=1e-6)
    np.testing.assert_array_equal(frame.mask, MASK)
    assert frame.camera is CAMERA
    empty = decode_frame(CAMERA, ImageBytes())
    assert (empty.rgb, empty.depth_m, empty.mask) == (None, None, None)


@pytest.mark.parametrize(
    ("images", "field"),
    [
        (ImageBytes(rgb=b"junk"), "rgb_front"),
        (ImageBytes(depth=RGB_PNG), "depth_front"),
        (ImageBytes(RGB_PNG, DEPTH_PNG, RGB_PNG), "mask_front"),
        (ImageBytes(depth=DEPTH_PNG, mask=encoded(".png", MASK[:2].astype(np.uint16))), "depth_front"),
        (ImageBytes(depth=encoded(".png", np.full((400, 600), 500, np.uint16))), "depth_front"),
    ],
)
def test_errors_name_the_part(images, field):
    with pytest.raises(InvalidInputError) as caught:
        decode_frame(CAMERA, images)
    assert caught.value.field == field
