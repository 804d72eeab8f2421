"""Encoded images -> arrays, without trusting what they claim to be.

An image is a PNG, a JPEG or a `.npy` array. Its size is read from the header before anything is decoded: a PNG of
389 kB can unfold to 1.2 GB.
"""

import io
import os
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from app.pipeline.errors import InvalidInputError

MAX_PIXELS = 16_000_000  # 4k UHD has 8.3 million
# OpenCV reads its limit once, when it is loaded.
os.environ["OPENCV_IO_MAX_IMAGE_PIXELS"] = str(MAX_PIXELS)
import cv2  # noqa: E402

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"
_JPEG = b"\xff\xd8\xff"
_JPEG_END = b"\xff\xd9"
_NPY = b"\x93NUMPY"
_VALID = {
    "rgb": "a PNG or JPEG of 8 bits a channel, or a .npy array (H, W, 3) uint8",
    "depth": "a 16-bit PNG in units of the camera's depth_scale, or a .npy array (H, W) of metres",
    "mask": "an 8- or 16-bit PNG of object ids, or a .npy array (H, W) of integers",
}


def decode_rgb(field: str, data: bytes) -> npt.NDArray[np.uint8]:
    """An (H, W, 3) uint8 image, red first."""
    if data.startswith(_NPY):
        array = _load_npy(field, data, "rgb")
        if array.ndim != 3 or array.shape[2] != 3 or array.dtype != np.uint8:
            raise InvalidInputError(field, f"is an array {array.shape} {array.dtype}", _VALID["rgb"])
        return np.ascontiguousarray(array)
    image = _decode(field, data, cv2.IMREAD_COLOR, "rgb")
    return np.ascontiguousarray(image[..., ::-1])


def decode_depth(field: str, data: bytes, depth_scale: float) -> npt.NDArray[np.float32]:
    """An (H, W) float32 image of metres; 0 where the depth is unknown.

    Args:
        depth_scale: metres per unit of a 16-bit image.
    """
    if data.startswith(_NPY):
        array = _load_npy(field, data, "depth")
        if array.ndim != 2 or array.dtype.kind != "f":
            raise InvalidInputError(field, f"is an array {array.shape} {array.dtype}", _VALID["depth"])
        depth_m = array.astype(np.float32)
        if (np.nan_to_num(depth_m) < 0).any():
            raise InvalidInputError(field, f"has a depth of {float(np.nanmin(depth_m)):g} m", "0 (unknown) or positive")
        return np.where(np.isfinite(depth_m), depth_m, np.float32(0))
    image = _decode(field, data, cv2.IMREAD_UNCHANGED, "depth")
    if image.ndim != 2 or image.dtype != np.uint16:
        raise InvalidInputError(field, f"is an image {image.shape} {image.dtype}", _VALID["depth"])
    return image.astype(np.float32) * np.float32(depth_scale)


def decode_mask(field: str, data: bytes) -> npt.NDArray[np.int32]:
    """An (H, W) int32 image of object ids."""
    if data.startswith(_NPY):
        array = _load_npy(field, data, "mask")
    else:
        array = _decode(field, data, cv2.IMREAD_UNCHANGED, "mask")
    if array.ndim != 2 or array.dtype.kind not in "iub":
        raise InvalidInputError(field, f"is an array {array.shape} {array.dtype}", _VALID["mask"])
    return array.astype(np.int32)


def as_image(data: bytes, kind: Literal["rgb", "depth"], depth_scale: float) -> tuple[bytes, str]:
    """Stored image bytes as a file that a browser can show, with its media type; arrays become a PNG."""
    if data.startswith(_JPEG):
        return data, "image/jpeg"
    if data.startswith(_PNG):
        return data, "image/png"
    if kind == "rgb":
        image: npt.NDArray[np.integer[Any]] = decode_rgb("rgb", data)[..., ::-1]
    else:
        units = np.rint(decode_depth("depth", data, depth_scale) / depth_scale)
        image = np.minimum(units, np.iinfo(np.uint16).max).astype(np.uint16)
    return cv2.imencode(".png", image)[1].tobytes(), "image/png"


def _decode(field: str, data: bytes, flags: int, kind: Literal["rgb", "depth", "mask"]) -> npt.NDArray[np.generic]:
    if not data:
        raise InvalidInputError(field, "is empty", _VALID[kind])
    if not data.startswith((_PNG, _JPEG)):
        raise InvalidInputError(field, f"begins with {data[:8]!r}", _VALID[kind])
    if (_PNG_END if data.startswith(_PNG) else _JPEG_END) not in data[-64:]:
        raise InvalidInputError(field, f"is cut off after {len(data)} bytes", _VALID[kind])
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        limit = "validateInputImageSize" in str(error)
        message = f"has more than {MAX_PIXELS} pixels" if limit else f"cannot be decoded: {error.err}"
        raise InvalidInputError(field, message, _VALID[kind]) from None
    if image is None:
        raise InvalidInputError(field, f"is damaged: {len(data)} bytes that do not decode", _VALID[kind])
    return image


def _load_npy(field: str, data: bytes, kind: str) -> npt.NDArray[np.generic]:
    try:
        stream = io.BytesIO(data)
        version = np.lib.format.read_magic(stream)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(stream)
        if dtype.hasobject:
            raise InvalidInputError(field, "contains a pickle, which is never loaded", _VALID[kind])
        if len(shape) >= 2:
            _check_pixels(field, shape[1] * shape[0])
        array: npt.NDArray[np.generic] = np.load(io.BytesIO(data), allow_pickle=False)
    except (EOFError, ValueError, OSError) as error:
        if isinstance(error, InvalidInputError):
            raise
        raise InvalidInputError(field, f"is a damaged .npy array: {error}", _VALID[kind]) from None
    return array


def _check_pixels(field: str, pixels: int) -> None:
    if not 0 < pixels <= MAX_PIXELS:
        raise InvalidInputError(field, f"claims {pixels} pixels", f"1 to {MAX_PIXELS} pixels")
