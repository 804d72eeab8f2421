"""Episodes and observations -> the parts of an HTTP request."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from app.pipeline.episode import RgbdFrame

Part = tuple[str, bytes, str]
JPEG_QUALITY = 95
_MAX_DEPTH_UNITS = np.iinfo(np.uint16).max


def request_parts(metadata: Mapping[str, Any], frames: Sequence[RgbdFrame]) -> dict[str, Part]:
    """The multipart files of a request: `metadata`, and every image of every frame."""
    parts: dict[str, Part] = {"metadata": ("metadata.json", json.dumps(metadata).encode(), "application/json")}
    for frame in frames:
        parts.update(_image_parts(frame))
    return parts


def _image_parts(frame: RgbdFrame) -> dict[str, Part]:
    name, parts = frame.camera.name, {}
    if frame.rgb is not None:
        jpeg = cv2.imencode(".jpg", frame.rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
        parts[f"rgb_{name}"] = (f"rgb_{name}.jpg", jpeg.tobytes(), "image/jpeg")
    if frame.depth_m is not None:
        units = np.minimum(np.rint(frame.depth_m / frame.camera.depth_scale), _MAX_DEPTH_UNITS)
        parts[f"depth_{name}"] = _png16(f"depth_{name}", units)
    if frame.mask is not None:
        parts[f"mask_{name}"] = _png16(f"mask_{name}", frame.mask)
    return parts


def _png16(name: str, image: np.ndarray[Any, Any]) -> Part:
    return f"{name}.png", cv2.imencode(".png", image.astype(np.uint16))[1].tobytes(), "image/png"
