"""An episode in the form of an upload (`Parcel`), and a dataset of such episodes."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.datasets.bounds import DamagedError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, camera_json
from roboprompt_client.types.names import checked_instruction, checked_name
from roboprompt_client.types.trajectory import Trajectory, npz_from_trajectory

FINE_M, COARSE_M = 0.0001, 0.001  # meters per unit: 16 bits reach 6.5 m or 65 m
_MAX_UNITS = np.iinfo(np.uint16).max
KEY_PREFIX = "import-"
EDITED = ("left_out", "note", "uploaded_instruction")  # metadata that corrections of an episode change


def depth_png(depth_m: Array) -> tuple[bytes, float]:
    """Encode (H, W) meters as a 16-bit PNG. Return it and its depth scale, 0.1 mm if that reaches far enough."""
    known_m = np.where(np.isfinite(depth_m) & (depth_m > 0), depth_m, 0.0)
    scale = FINE_M if known_m.max(initial=0) <= FINE_M * _MAX_UNITS else COARSE_M
    units = np.rint(known_m / scale)
    units[units > _MAX_UNITS] = 0  # farther than 16 bits can express: unknown
    return _png(units.astype(np.uint16)), scale


def mask_png(ids: npt.NDArray[np.integer]) -> bytes:
    """Encode (H, W) ids below 65536 as a 16-bit PNG; raises DamagedError for larger ids."""
    if ids.min(initial=0) < 0 or ids.max(initial=0) > _MAX_UNITS:
        raise DamagedError("mask", f"has ids from {ids.min()} to {ids.max()}, expected 0 to {_MAX_UNITS}")
    return _png(ids.astype(np.uint16))


def rgb_png(rgb: npt.NDArray[np.uint8]) -> bytes:
    """Encode (H, W, 3) RGB as a PNG."""
    return _png(np.ascontiguousarray(rgb[..., ::-1]))


def _png(image: npt.NDArray[np.integer]) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


@dataclass(frozen=True)
class ObjectEntry:
    """An object of a scene with its pose in the world frame, or its ids in the masks.

    With neither, the service finds it in the images by the task's object models.

    Attributes:
        low_dim_state: index of its pose in RLBench's `task_low_dim_state`; the reader replaces it by the pose.
    """

    name: str
    position_m: tuple[float, ...] | None = None
    quaternion_xyzw: tuple[float, ...] | None = None
    mask_ids: tuple[int, ...] = ()
    low_dim_state: int | None = None

    def as_json(self) -> dict[str, Any]:
        document: dict[str, Any] = {"name": self.name}
        if self.position_m is not None:
            document["position"] = list(self.position_m)
        if self.quaternion_xyzw is not None:
            document["quaternion_xyzw"] = list(self.quaternion_xyzw)
        if self.mask_ids:
            document["mask_ids"] = list(self.mask_ids)
        return document


@dataclass(frozen=True, eq=False)
class Parcel:
    """An episode as it is uploaded: the metadata, and the trajectory and images as files."""

    metadata: Mapping[str, Any]
    files: Mapping[str, bytes]
    notes: tuple[str, ...] = ()  # what the dataset lacks that an upload could have

    @classmethod
    def of(
        cls,
        *,
        task: str,
        instruction: str,
        trajectory: Trajectory,
        control_frequency_hz: float,
        objects: Sequence[ObjectEntry],
        cameras: Sequence[Camera] = (),
        images: Mapping[str, bytes] | None = None,
        extra: Mapping[str, Any] | None = None,
        notes: tuple[str, ...] = (),
    ) -> "Parcel":
        """Return the parcel of an episode that a reader has read.

        Args:
            images: encoded images of the first frame, by rgb_NAME, depth_NAME, mask_NAME.
            extra: stored with the episode, not interpreted.

        Raises:
            InvalidInputError: for invalid names or an invalid instruction.
        """
        metadata = {
            "task": checked_name("task", task),
            "instruction": checked_instruction("instruction", instruction),
            "objects": [item.as_json() for item in objects],
            "cameras": [camera_json(camera) for camera in cameras],
            "control_frequency_hz": control_frequency_hz,
            "extra": dict(extra or {}),
        }
        return cls(metadata, {"trajectory": npz_from_trajectory(trajectory), **(images or {})}, notes)

    @property
    def key(self) -> str:
        """An idempotency key from the content; exports and edits keep it."""
        digest = hashlib.sha256(canonical_json(_essence(_as_uploaded(self.metadata))))
        for name in sorted(self.files):
            digest.update(f"\0{name}\0".encode() + hashlib.sha256(self.files[name]).digest())
        return f"{KEY_PREFIX}{digest.hexdigest()}"


@dataclass(frozen=True)
class Entry:
    """One episode of a dataset, which is read later."""

    name: str  # within the dataset, for messages
    read: Callable[[], Parcel]  # raises DamagedError or InvalidInputError


@dataclass(frozen=True)
class Dataset:
    """An opened dataset.

    Attributes:
        task_settings: of the dataset's tasks, by name.
        damaged: files that could not be listed as episodes, with the reason.
    """

    format: str
    entries: tuple[Entry, ...]
    task_settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()


def checked_metadata(where: object, metadata: Any) -> dict[str, Any]:  # noqa: ANN401
    """Check an upload's metadata from a file; raises DamagedError, or InvalidInputError for a task's name."""
    if not isinstance(metadata, dict) or not isinstance(metadata.get("task"), str):
        raise DamagedError(where, "names no task")
    checked_name("task", metadata["task"])
    for part in ("objects", "cameras"):
        items = metadata.setdefault(part, [])
        if not isinstance(items, list) or not all(isinstance(item, dict) and "name" in item for item in items):
            raise DamagedError(where, f"has {part} without names")
    return metadata


def canonical_json(value: object) -> bytes:
    """Encode a document; the order of its keys does not matter."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode()


def _as_uploaded(metadata: Mapping[str, Any]) -> dict[str, Any]:
    first = metadata.get("uploaded_instruction") or metadata["instruction"]
    kept = {name: value for name, value in metadata.items() if name not in EDITED}
    return {**kept, "instruction": first}


def _essence(value: Any) -> Any:  # noqa: ANN401
    """Return the document without empty values and with integers as floats, which services write in both ways."""
    if isinstance(value, Mapping):
        return {name: _essence(item) for name, item in value.items() if item is not None and item not in ([], (), {})}
    if isinstance(value, list | tuple):
        return [_essence(item) for item in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
