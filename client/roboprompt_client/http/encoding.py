"""Episodes and observations -> the parts of an HTTP request."""

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from importlib.util import find_spec
from typing import Any

import numpy as np

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import RgbdFrame, camera_json
from roboprompt_client.types.npy import packed_array
from roboprompt_client.types.poses import object_json

Part = tuple[str, bytes, str]
JPEG_QUALITY = 95
_MAX_DEPTH_UNITS = np.iinfo(np.uint16).max


class ImageFormat(Enum):
    """How images travel."""

    COMPRESSED = "JPEG and 16-bit PNG"  # OpenCV
    PACKED = "MessagePack"  # as they are, in one document: msgpack
    PLAIN = ".npy"  # as they are; numpy alone

    @classmethod
    def chosen(cls, compress: bool | None) -> "ImageFormat":
        """What the setting asks for with the packages that are installed; None: compressed where that can be.

        Raises:
            InvalidInputError: if images are to be compressed and OpenCV is missing.
        """
        if compress is not False and find_spec("cv2"):
            return cls.COMPRESSED
        if compress:
            raise InvalidInputError("compress", "needs OpenCV, which is not installed", "roboprompt-client[images]")
        return cls.PACKED if find_spec("msgpack") else cls.PLAIN


def request_parts(
    metadata: Mapping[str, Any], frames: Sequence[RgbdFrame], images: ImageFormat = ImageFormat.PLAIN
) -> dict[str, Part]:
    """The multipart files of a request: `metadata`, and every image of every frame."""
    encoded = _compressed if images is ImageFormat.COMPRESSED else _plain
    parts: dict[str, Part] = {"metadata": ("metadata.json", json.dumps(metadata).encode(), "application/json")}
    for frame in frames:
        parts |= {name: encoded(name, image, frame) for name, image in _images(frame)}
    return parts


def packed_request(document: Mapping[str, Any], frames: Sequence[RgbdFrame]) -> bytes:
    """The same as one MessagePack document: images are not compressed, which costs neither side time."""
    import msgpack

    arrays = {name: packed_array(image) for frame in frames for name, image in _images(frame)}
    packed: bytes = msgpack.packb({**document, **arrays})
    return packed


def prediction_request(
    task: str | None,
    instruction: str,
    observation: Observation,
    mask_ids: Mapping[str, Sequence[int]] | None,
    options: Mapping[str, Any],
    images: ImageFormat,
) -> dict[str, Any]:
    """The body of `POST /predict`, as arguments of httpx."""
    document = {"task": task, "instruction": instruction, **scene_json(observation, mask_ids), **options}
    if (pose := observation.end_effector) is not None:
        document["end_effector"] = {"position": pose.position_m, "quaternion_xyzw": pose.quaternion_xyzw}
    if not observation.frames:
        return {"json": document}
    if images is ImageFormat.PACKED:
        packed = packed_request(document, observation.frames)
        return {"content": packed, "headers": {"Content-Type": "application/msgpack"}}
    return {"files": request_parts(document, observation.frames, images)}


def _images(frame: RgbdFrame) -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """The images that there are, by the names of their parts."""
    for kind, image in (("rgb", frame.rgb), ("depth", frame.depth_m), ("mask", frame.mask)):
        if image is not None:
            yield f"{kind}_{frame.camera.name}", image


def _plain(name: str, image: np.ndarray[Any, Any], _: RgbdFrame) -> Part:
    stream = io.BytesIO()
    np.save(stream, image, allow_pickle=False)
    return f"{name}.npy", stream.getvalue(), "application/octet-stream"


def _compressed(name: str, image: np.ndarray[Any, Any], frame: RgbdFrame) -> Part:
    import cv2

    if image is frame.rgb:
        jpeg = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
        return f"{name}.jpg", jpeg.tobytes(), "image/jpeg"
    if image is frame.depth_m:
        image = np.minimum(np.rint(image / frame.camera.depth_scale), _MAX_DEPTH_UNITS)
    return f"{name}.png", cv2.imencode(".png", image.astype(np.uint16))[1].tobytes(), "image/png"


def scene_json(observation: Observation, mask_ids: Mapping[str, Sequence[int]] | None) -> dict[str, Any]:
    """What the robot sees, as the requests have it: objects with a pose, with a mask, or to be found."""
    if not isinstance(observation, Observation):
        raise InvalidInputError("observation", f"is a {type(observation).__name__}", "Observation(poses)")
    unnamed = {name: list(ids) for name, ids in {**observation.mask_ids, **(mask_ids or {})}.items()}
    objects: list[dict[str, Any]] = [object_json(pose) for pose in observation.objects]
    objects += [{"name": name} for name in observation.to_find]
    for item in objects:
        if (ids := unnamed.pop(item["name"], None)) is not None:
            item["mask_ids"] = ids
    objects += [{"name": name, "mask_ids": ids} for name, ids in unnamed.items()]
    return {"objects": objects, "cameras": [camera_json(frame.camera) for frame in observation.frames]}
