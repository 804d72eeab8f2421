"""The protocol of `POST /poses`, for clients and servers; docs/foundationpose.md describes it.

A request is multipart/form-data: the part `metadata`, a JSON document with `objects` and `cameras`, and the images
`rgb_NAME`, `depth_NAME`, `mask_NAME` of each camera. The reply is a JSON document with `poses`.
"""

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import finite_array, unit_quaternions
from roboprompt_client.types.camera import RgbdFrame, camera_json
from roboprompt_client.types.poses import ObjectPose

Part = tuple[str, bytes, str]
_MAX_UINT16 = np.iinfo(np.uint16).max
MAX_REASON_CHARS = 300


@dataclass(frozen=True, eq=False)
class PoseAnswer:
    """A server's pose of an object.

    Attributes:
        position_m: (3,) in the world frame; None if the object was not found.
        quaternion_xyzw: (4,) in the world frame, or None.
        confidence: 0..1.
        reason: what lowers the confidence, or why it was not found.
        cameras: the cameras that see it.
    """

    name: str
    position_m: npt.NDArray[np.float64] | None
    quaternion_xyzw: npt.NDArray[np.float64] | None
    confidence: float
    reason: str
    cameras: tuple[str, ...]


def request_parts(objects: Sequence[Mapping[str, Any]], frames: Sequence[RgbdFrame]) -> dict[str, Part]:
    """Return a request's parts (file name, content, media type). Lossless, but depth is rounded to `depth_scale`.

    Args:
        objects: each to find: its `name`, `mask_ids` (of its pixels in mask images) and `model`, as JSON.
    """
    metadata = {"objects": list(objects), "cameras": [camera_json(frame.camera) for frame in frames]}
    parts: dict[str, Part] = {"metadata": ("metadata.json", json.dumps(metadata).encode(), "application/json")}
    for frame in frames:
        name = frame.camera.name
        if frame.rgb is not None:
            parts[f"rgb_{name}"] = _png(f"rgb_{name}", frame.rgb[..., ::-1])
        if frame.depth_m is not None:
            units = np.minimum(np.rint(frame.depth_m / frame.camera.depth_scale), _MAX_UINT16)
            parts[f"depth_{name}"] = _png(f"depth_{name}", units.astype(np.uint16))
        if frame.mask is not None:
            parts[f"mask_{name}"] = _mask(f"mask_{name}", frame.mask)
    return parts


def poses_document(poses: Sequence[ObjectPose]) -> dict[str, Any]:
    """Return the reply with these poses."""
    return {
        "poses": [
            {
                "name": pose.name,
                "position": pose.position_m.tolist(),
                "quaternion_xyzw": None if pose.quaternion_xyzw is None else pose.quaternion_xyzw.tolist(),
                "confidence": pose.confidence,
                "reason": pose.reason,
                "cameras": list(pose.cameras),
            }
            for pose in poses
        ]
    }


def answers_from_json(document: object, names: Sequence[str], cameras: Sequence[str]) -> tuple[PoseAnswer, ...]:
    """Return the poses of a reply; an object may have several, e.g. one per camera.

    Args:
        names: of the requested objects; the reply must contain all of them and no others.
        cameras: names of the cameras whose images were sent.

    Raises:
        InvalidInputError: naming the invalid field of the reply, e.g. ``poses[0].position``.
    """
    items = document.get("poses") if isinstance(document, dict) else None
    if not isinstance(items, list):
        raise InvalidInputError("poses", "is missing", '{"poses": [{"name": ..., "position": [x, y, z]}]}')
    answers = tuple(_answer(f"poses[{index}]", item, names, cameras) for index, item in enumerate(items))
    if unanswered := [name for name in names if name not in {answer.name for answer in answers}]:
        raise InvalidInputError(
            "poses", f"has no {unanswered[0]!r}", "an entry for every object, position null if lost"
        )
    return answers


def _png(name: str, image: npt.NDArray[Any]) -> Part:
    return f"{name}.png", cv2.imencode(".png", image)[1].tobytes(), "image/png"


def _mask(name: str, mask: npt.NDArray[np.int32]) -> Part:
    if mask.min(initial=0) >= 0 and mask.max(initial=0) <= _MAX_UINT16:
        return _png(name, mask.astype(np.uint16))
    file = io.BytesIO()
    np.save(file, mask)
    return f"{name}.npy", file.getvalue(), "application/octet-stream"


def _answer(where: str, item: object, names: Sequence[str], cameras: Sequence[str]) -> PoseAnswer:
    if not isinstance(item, dict):
        raise InvalidInputError(where, f"is {item!r:.80}", "an object with name and position")
    position, quaternion = item.get("position"), item.get("quaternion_xyzw")
    confidence, seen_by = item.get("confidence", 1.0), item.get("cameras") or []
    if isinstance(confidence, bool) or not isinstance(confidence, int | float) or not 0 <= confidence <= 1:
        raise InvalidInputError(f"{where}.confidence", f"is {confidence!r:.80}", "a number in 0..1")
    if not isinstance(seen_by, list):
        raise InvalidInputError(f"{where}.cameras", f"is {seen_by!r:.80}", "a list of cameras")
    return PoseAnswer(
        _one_of(f"{where}.name", item.get("name"), names),
        None if position is None else finite_array(f"{where}.position", position, (3,)),
        None if quaternion is None else unit_quaternions(f"{where}.quaternion_xyzw", quaternion, (4,)),
        float(confidence),
        str(item.get("reason") or "")[:MAX_REASON_CHARS],
        tuple(_one_of(f"{where}.cameras", camera, cameras) for camera in seen_by),
    )


def _one_of(where: str, value: object, known: Sequence[str]) -> str:
    if not isinstance(value, str) or value not in known:
        raise InvalidInputError(where, f"is {value!r:.80}", ", ".join(known))
    return value
