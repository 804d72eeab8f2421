"""Requests whose bodies have observations or files: JSON, or multipart with the images."""

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import RgbdFrame, camera_json
from roboprompt_client.types.poses import object_json
from roboprompt_client.types.trajectory import Trajectory, npz_from_trajectory

Part = tuple[str, bytes, str]
BYTES = "application/octet-stream"
CONTENT_TYPES = {".json": "application/json", ".jpg": "image/jpeg", ".png": "image/png", ".npy": BYTES, ".npz": BYTES}
LONGEST_S = 600.0  # that the service gives a model where a request names no deadline
JPEG_QUALITY = 95
_MAX_DEPTH_UNITS = np.iinfo(np.uint16).max


def request_parts(metadata: Mapping[str, Any], frames: Sequence[RgbdFrame]) -> dict[str, Part]:
    """Return the multipart files of a request: `metadata` as JSON, and every image of every frame.

    Images travel as JPEG and 16-bit PNG where OpenCV is installed (extra `images`), else as `.npy`.
    """
    encoded = _compressed if find_spec("cv2") else _npy_part
    parts: dict[str, Part] = {"metadata": ("metadata.json", json.dumps(metadata).encode(), "application/json")}
    for frame in frames:
        parts |= {name: encoded(name, image, frame) for name, image in _images_of(frame)}
    return parts


def episode_parts(metadata: Mapping[str, Any], trajectory: Trajectory, observation: Observation) -> dict[str, Part]:
    """Return the multipart files of `POST /episodes`; the observation's objects and cameras are added to `metadata`."""
    parts = request_parts({**metadata, **scene_json(observation)}, observation.frames)
    return {**parts, "trajectory": ("trajectory.npz", npz_from_trajectory(trajectory), BYTES)}


def _images_of(frame: RgbdFrame) -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """Yield the frame's images with the names of their parts, such as `rgb_front`."""
    for kind, image in (("rgb", frame.rgb), ("depth", frame.depth_m), ("mask", frame.mask)):
        if image is not None:
            yield f"{kind}_{frame.camera.name}", image


def _npy_part(name: str, image: np.ndarray[Any, Any], _: RgbdFrame) -> Part:
    """Return an image as a `.npy` file."""
    stream = io.BytesIO()
    np.save(stream, image, allow_pickle=False)
    return f"{name}.npy", stream.getvalue(), BYTES


def _compressed(name: str, image: np.ndarray[Any, Any], frame: RgbdFrame) -> Part:
    import cv2

    if image is frame.rgb:
        quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
        return f"{name}.jpg", cv2.imencode(".jpg", image[..., ::-1], quality)[1].tobytes(), "image/jpeg"
    if image is frame.depth_m:
        image = np.minimum(np.rint(image / frame.camera.depth_scale), _MAX_DEPTH_UNITS)
    return f"{name}.png", cv2.imencode(".png", image.astype(np.uint16))[1].tobytes(), "image/png"


def scene_json(observation: Observation) -> dict[str, Any]:
    """Return `objects` (with a pose, with mask ids, or only a name to be found) and `cameras` of a request."""
    if not isinstance(observation, Observation):
        raise InvalidInputError("observation", f"is a {type(observation).__name__}", "Observation(poses)")
    unnamed = {name: list(ids) for name, ids in observation.mask_ids.items()}
    objects: list[dict[str, Any]] = [object_json(pose) for pose in observation.objects]
    objects += [{"name": name} for name in observation.to_find]
    for item in objects:
        if (ids := unnamed.pop(item["name"], None)) is not None:
            item["mask_ids"] = ids
    objects += [{"name": name, "mask_ids": ids} for name, ids in unnamed.items()]
    return {"objects": objects, "cameras": [camera_json(frame.camera) for frame in observation.frames]}
