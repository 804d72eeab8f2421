"""Episodes and observations -> the parts of an HTTP request."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import msgpack
import numpy as np

from app.client.robot import Observation
from app.pipeline.camera import RgbdFrame
from app.pipeline.metadata import camera_json, object_json
from app.pipeline.packed_array import packed_array

Part = tuple[str, bytes, str]
JPEG_QUALITY = 95
_MAX_DEPTH_UNITS = np.iinfo(np.uint16).max


def request_parts(metadata: Mapping[str, Any], frames: Sequence[RgbdFrame]) -> dict[str, Part]:
    """The multipart files of a request: `metadata`, and every image of every frame."""
    parts: dict[str, Part] = {"metadata": ("metadata.json", json.dumps(metadata).encode(), "application/json")}
    for frame in frames:
        parts.update(_image_parts(frame))
    return parts


def packed_request(document: Mapping[str, Any], frames: Sequence[RgbdFrame]) -> bytes:
    """The same as one MessagePack document: images are not compressed, which costs neither side time."""
    arrays: dict[str, Any] = {}
    for frame in frames:
        images = (("rgb", frame.rgb), ("depth", frame.depth_m), ("mask", frame.mask))
        arrays |= {f"{kind}_{frame.camera.name}": packed_array(image) for kind, image in images if image is not None}
    packed: bytes = msgpack.packb({**document, **arrays})
    return packed


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


def scene_json(observation: Observation, mask_ids: Mapping[str, Sequence[int]] | None) -> dict[str, Any]:
    """What the robot sees, as the requests have it: objects with a pose, with a mask, or to be found."""
    unnamed = {name: list(ids) for name, ids in (mask_ids or {}).items()}
    objects: list[dict[str, Any]] = [object_json(pose) for pose in observation.objects]
    objects += [{"name": name} for name in observation.to_find]
    for item in objects:
        if (ids := unnamed.pop(item["name"], None)) is not None:
            item["mask_ids"] = ids
    objects += [{"name": name, "mask_ids": ids} for name, ids in unnamed.items()]
    return {"objects": objects, "cameras": [camera_json(frame.camera) for frame in observation.frames]}
