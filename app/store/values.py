"""Values and types of columns: keyframes, objects and cameras <-> JSON, and <-> the pipeline's values.

Not the pipeline's own classes, because these check every array: ten demonstrations would take longer to check than to
read.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal, Self

import numpy as np
from sqlalchemy import JSON, BigInteger, DateTime, Dialect, Integer, TypeDecorator

from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, camera_from_json
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

JsonObject = dict[str, Any]
ImageKind = Literal["rgb", "depth", "mask"]


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(values.tolist())


class _Record:
    """A value in a column: fields that JSON has, where they lose their unit."""

    def to_json(self) -> JsonObject:
        return {name.removesuffix("_m"): value for name, value in vars(self).items()}


@dataclass(frozen=True)
class ObjectRecord(_Record):
    """An object's pose at a frame of an episode: position (3) m, and quaternion (4) or None, in the world frame."""

    name: str
    position_m: tuple[float, ...]
    quaternion_xyzw: tuple[float, ...] | None = None
    estimator: str = "given"
    cameras: tuple[str, ...] = ()
    confidence: float = 1.0
    reason: str = ""

    @classmethod
    def of(cls, pose: ObjectPose) -> Self:
        quaternion = None if pose.quaternion_xyzw is None else _floats(pose.quaternion_xyzw)
        found = (pose.estimator, pose.cameras, pose.confidence, pose.reason)
        return cls(pose.name, _floats(pose.position_m), quaternion, *found)

    def pose(self) -> ObjectPose:
        quaternion = None if self.quaternion_xyzw is None else np.array(self.quaternion_xyzw)
        found = (self.estimator, self.cameras, self.confidence, self.reason)
        return ObjectPose(self.name, np.array(self.position_m), quaternion, *found)

    @classmethod
    def from_json(cls, value: JsonObject) -> Self:
        quaternion = value["quaternion_xyzw"]
        return cls(
            value["name"],
            tuple(value["position"]),
            None if quaternion is None else tuple(quaternion),
            value["estimator"],
            tuple(value["cameras"]),
            value["confidence"],
            value["reason"],
        )


@dataclass(frozen=True)
class KeyframeRecord(_Record):
    """The action at frame `index` of an episode: position (3) m and quaternion (4) in the world frame."""

    index: int
    position_m: tuple[float, ...]
    quaternion_xyzw: tuple[float, ...]
    gripper_open: bool

    @classmethod
    def of(cls, index: int, action: EndEffectorAction) -> Self:
        position, quaternion = _floats(action.position_m), _floats(action.quaternion_xyzw)
        return cls(index, position, quaternion, action.gripper_open)

    def action(self) -> EndEffectorAction:
        return EndEffectorAction(np.array(self.position_m), np.array(self.quaternion_xyzw), self.gripper_open)

    @classmethod
    def from_json(cls, value: JsonObject) -> Self:
        position, quaternion = tuple(value["position"]), tuple(value["quaternion_xyzw"])
        return cls(value["index"], position, quaternion, value["gripper_open"])


@dataclass(frozen=True)
class CameraRecord(_Record):
    """A camera, and the digests of its encoded images of the first frame, as uploaded."""

    calibration: JsonObject  # as an upload's metadata has it (`camera_json`)
    rgb_digest: str | None = None
    depth_digest: str | None = None
    mask_digest: str | None = None

    @property
    def name(self) -> str:
        return str(self.calibration["name"])

    @property
    def has_rgbd(self) -> bool:
        return self.rgb_digest is not None and self.depth_digest is not None

    def digest(self, kind: ImageKind) -> str | None:
        return {"rgb": self.rgb_digest, "depth": self.depth_digest, "mask": self.mask_digest}[kind]

    def camera(self) -> Camera:
        return camera_from_json(self.calibration)

    @classmethod
    def from_json(cls, value: JsonObject) -> Self:
        return cls(**value)


class UtcDateTime(TypeDecorator[datetime]):
    """An aware datetime, always UTC; SQLite stores none of a datetime's zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        return None if value is None else value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


# Python's None is SQL's NULL, never JSON's `null`.
Json = JSON(none_as_null=True)


class Items(TypeDecorator[tuple[Any, ...]]):
    """A tuple of records, or without their class of what JSON has; a list in JSON."""

    impl = Json
    cache_ok = True

    def __init__(self, record: type[KeyframeRecord | ObjectRecord | CameraRecord] | None = None) -> None:
        super().__init__()
        self.record = record

    def process_bind_param(self, value: tuple[Any, ...] | None, dialect: Dialect) -> list[Any] | None:
        return value if value is None else [item.to_json() for item in value] if self.record else list(value)

    def process_result_value(self, value: list[Any] | None, dialect: Dialect) -> tuple[Any, ...] | None:
        return value if value is None else tuple(map(self.record.from_json, value) if self.record else value)


# SQLite numbers rows by itself only where the type is spelled INTEGER.
SequenceNumber = BigInteger().with_variant(Integer, "sqlite")
