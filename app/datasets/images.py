"""Arrays -> the image files of an upload."""

import cv2
import numpy as np
import numpy.typing as npt

from app.datasets.errors import DamagedError
from app.pipeline.arrays import Array

FINE_M, COARSE_M = 0.0001, 0.001  # metres a unit: 16 bits reach 6.5 m or 65 m
_MAX_UNITS = np.iinfo(np.uint16).max


def depth_png(depth_m: Array) -> tuple[bytes, float]:
    """(H, W) metres -> a 16-bit PNG and its depth scale: a tenth of a millimetre where that reaches far enough."""
    known_m = np.where(np.isfinite(depth_m) & (depth_m > 0), depth_m, 0.0)
    scale = FINE_M if known_m.max(initial=0) <= FINE_M * _MAX_UNITS else COARSE_M
    units = np.rint(known_m / scale)
    units[units > _MAX_UNITS] = 0  # farther than can be said: unknown
    return _png(units.astype(np.uint16)), scale


def mask_png(ids: npt.NDArray[np.integer]) -> bytes:
    """(H, W) ids below 65536 -> a 16-bit PNG.

    Raises:
        DamagedError: for larger ids.
    """
    if ids.min(initial=0) < 0 or ids.max(initial=0) > _MAX_UNITS:
        raise DamagedError("mask", f"has ids from {ids.min()} to {ids.max()}, expected 0 to {_MAX_UNITS}")
    return _png(ids.astype(np.uint16))


def rgb_png(rgb: npt.NDArray[np.uint8]) -> bytes:
    """(H, W, 3) red first -> a PNG."""
    return _png(np.ascontiguousarray(rgb[..., ::-1]))


def _png(image: npt.NDArray[np.integer]) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()
