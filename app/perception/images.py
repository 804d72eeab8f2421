"""Untrusted encoded images -> arrays, and a camera's images -> RgbdFrame.

An image is a PNG, a JPEG or a `.npy` array. Its header is read before it is decoded: a PNG of 389 kB can expand to
1.2 GB.
"""

import re
import struct
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

from app.untrusted_arrays import array_from_npy
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame

# 4k UHD has 8.3 million. OpenCV's own limit is an environment variable that it reads once, when it is loaded.
MAX_PIXELS = 16_000_000
_NPY = b"\x93NUMPY"
# Calibrations belong to the sensor's rows and columns, and so do depth and masks: no header may turn the picture.
_COLOR = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
_VALID = {
    "rgb": "a PNG or JPEG of 8 bits a channel, or a .npy array (H, W, 3) uint8",
    "depth": "a 16-bit PNG in units of the camera's depth_scale, or a .npy array (H, W) of meters",
    "mask": "an 8- or 16-bit PNG of object ids, or a .npy array (H, W) of integers",
}
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
PNG_END = b"IEND\xaeB`\x82"
_FRAME_BYTES = 12  # length and type before the data, checksum after it
MAX_SEGMENTS = 1000  # a color profile may fill 255
JPEG_SIGNATURE = b"\xff\xd8\xff"
JPEG_END = b"\xff\xd9"
# As libjpeg finds the next one: fill bytes before it, and none of those that stand alone (TEM, RST0 to RST7).
_MARKER = re.compile(rb"\xff+([^\x00\x01\xd0-\xd7\xff])", re.DOTALL)
_MAX_GAP = 1024  # bytes between segments, of which there should be none
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # ITU-T T.81, table B.1: these give the size
_WITHOUT_LENGTH = frozenset({0xD8, 0xD9})


def decode_rgb(field: str, data: bytes) -> npt.NDArray[np.uint8]:
    """Return an image (H, W, 3) of uint8, red first."""
    if data.startswith(_NPY):
        array = _load_npy(field, data, "rgb")
        if array.ndim != 3 or array.shape[2] != 3 or array.dtype != np.uint8:
            raise InvalidInputError(field, f"is an array {array.shape} {array.dtype}", _VALID["rgb"])
        return np.ascontiguousarray(array)
    image = _decode(field, data, _COLOR, "rgb")
    return np.ascontiguousarray(image[..., ::-1])


def decode_depth(field: str, data: bytes, depth_scale: float) -> npt.NDArray[np.float32]:
    """Return an image (H, W) of float32 meters; 0 where the depth is unknown.

    Args:
        depth_scale: meters per unit of a 16-bit image.
    """
    if data.startswith(_NPY):
        array = _load_npy(field, data, "depth")
        if array.ndim != 2 or array.dtype.kind != "f":
            raise InvalidInputError(field, f"is an array {array.shape} {array.dtype}", _VALID["depth"])
        depth_m = array.astype(np.float32, copy=False)
        if (depth_m < 0).any():
            raise InvalidInputError(field, f"has a depth of {float(np.nanmin(depth_m)):g} m", "0 (unknown) or positive")
        return np.where(np.isfinite(depth_m), depth_m, np.float32(0))
    image = _decode(field, data, cv2.IMREAD_UNCHANGED, "depth")
    if image.ndim != 2 or image.dtype != np.uint16:
        raise InvalidInputError(field, f"is an image {image.shape} {image.dtype}", _VALID["depth"])
    return image.astype(np.float32) * np.float32(depth_scale)


def decode_mask(field: str, data: bytes) -> npt.NDArray[np.int32]:
    """Return an image (H, W) of int32 object ids."""
    if data.startswith(_NPY):
        array = _load_npy(field, data, "mask")
    else:
        array = _decode(field, data, cv2.IMREAD_UNCHANGED, "mask")
    if array.ndim != 2 or array.dtype.kind not in "iub":
        raise InvalidInputError(field, f"is an array {array.shape} {array.dtype}", _VALID["mask"])
    ids = array.astype(np.int32)
    if (ids != array).any():
        raise InvalidInputError(field, f"has the id {array[ids != array][0]}", "ids of 32 bits")
    return ids


def as_image(data: bytes, kind: Literal["rgb", "depth", "mask"], depth_scale: float) -> tuple[bytes, str]:
    """Return a stored image as a file that browsers display, with its media type; arrays become a PNG."""
    if data.startswith(JPEG_SIGNATURE):
        return data, "image/jpeg"
    if data.startswith(PNG_SIGNATURE):
        return data, "image/png"
    if kind == "rgb":
        image: npt.NDArray[np.integer[Any]] = decode_rgb("rgb", data)[..., ::-1]
    elif kind == "mask":
        image = np.clip(decode_mask("mask", data), 0, np.iinfo(np.uint16).max).astype(np.uint16)
    else:
        units = np.rint(decode_depth("depth", data, depth_scale) / depth_scale)
        image = np.minimum(units, np.iinfo(np.uint16).max).astype(np.uint16)
    return cv2.imencode(".png", image)[1].tobytes(), "image/png"


@dataclass(frozen=True)
class ImageBytes:
    """One camera's images as uploaded, or None."""

    rgb: bytes | None = None
    depth: bytes | None = None
    mask: bytes | None = None


def decode_frame(camera: Camera, images: ImageBytes) -> RgbdFrame:
    """Return the camera's frame.

    Raises:
        InvalidInputError: naming the part (rgb_NAME, depth_NAME, mask_NAME) that is damaged or does not fit.
    """
    name = camera.name
    return RgbdFrame(
        camera,
        None if images.rgb is None else decode_rgb(f"rgb_{name}", images.rgb),
        None if images.depth is None else decode_depth(f"depth_{name}", images.depth, camera.depth_scale),
        None if images.mask is None else decode_mask(f"mask_{name}", images.mask),
    )


def _decode(field: str, data: bytes, flags: int, kind: Literal["rgb", "depth", "mask"]) -> npt.NDArray[np.generic]:
    if not data:
        raise InvalidInputError(field, "is empty", _VALID[kind])
    is_png = data.startswith(PNG_SIGNATURE)
    if not is_png and not data.startswith(JPEG_SIGNATURE):
        raise InvalidInputError(field, f"begins with {data[:8]!r}", _VALID[kind])
    if (PNG_END if is_png else JPEG_END) not in data[-64:]:
        raise InvalidInputError(field, f"is cut off after {len(data)} bytes", _VALID[kind])
    _check_pixels(field, num_pixels(data))
    if is_png and not _holds_its_chunks(data):
        raise InvalidInputError(field, "is damaged: a chunk claims more bytes than the file has", _VALID[kind])
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise InvalidInputError(field, f"cannot be decoded: {error.err}", _VALID[kind]) from None
    if image is None:
        raise InvalidInputError(field, f"is damaged: {len(data)} bytes that do not decode", _VALID[kind])
    return image


def num_pixels(data: bytes) -> int:
    """Return the number of pixels by the header of a PNG or JPEG; 0 if the header is invalid."""
    width, height = png_size(data) if data.startswith(PNG_SIGNATURE) else jpeg_size(data)
    return width * height


def _load_npy(field: str, data: bytes, kind: str) -> npt.NDArray[np.generic]:
    array = array_from_npy(field, data, _VALID[kind])
    if array.ndim >= 2:
        _check_pixels(field, array.shape[0] * array.shape[1])
    return array


def _check_pixels(field: str, pixels: int) -> None:
    if not 0 < pixels <= MAX_PIXELS:
        raise InvalidInputError(field, f"claims {pixels} pixels", f"1 to {MAX_PIXELS} pixels")


def png_size(data: bytes) -> tuple[int, int]:
    """Return width and height; (0, 0) if the header is truncated."""
    return struct.unpack_from(">II", data, 16) if len(data) >= 24 else (0, 0)


def _holds_its_chunks(data: bytes) -> bool:
    """Whether the file has the bytes that its chunks claim: the decoder would allocate them, up to 4 GB."""
    start = len(PNG_SIGNATURE)
    while start + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, start)
        start += length + _FRAME_BYTES
        if kind == b"IEND":
            break
    return start <= len(data)


def jpeg_size(data: bytes) -> tuple[int, int]:
    """Width and height; no pixels if the data ends before them."""
    position = 2
    for _ in range(MAX_SEGMENTS):
        match = _MARKER.search(data, position, position + _MAX_GAP)
        if match is None or match.end() + 7 > len(data):
            break
        marker, position = match[1][0], match.end()
        if marker in _FRAMES:
            height, width = struct.unpack_from(">HH", data, position + 3)
            return width, height
        if marker not in _WITHOUT_LENGTH:
            position += int.from_bytes(data[position : position + 2])
    return 0, 0
