"""Where the end effector is (`Pose`), where it shall go (`EndEffectorAction`), and where objects are (`ObjectPose`)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, finite_array, positions_array, settle, unit_quaternions
from roboprompt_client.types.names import checked_object_name


@dataclass(frozen=True, eq=False)
class EndEffectorAction:
    """An end-effector target: position (3,) m, quaternion (4,) xyzw, both in the world frame, and the gripper."""

    position_m: Array
    quaternion_xyzw: Array
    gripper_open: bool

    def __post_init__(self) -> None:
        settle(self, position_m=finite_array("action.position", self.position_m, (3,)))
        unit = unit_quaternions("action.quaternion_xyzw", self.quaternion_xyzw, (4,))
        settle(self, quaternion_xyzw=unit)

    @classmethod
    def many(
        cls, positions_m: npt.ArrayLike, quaternions_xyzw: npt.ArrayLike, gripper_open: Sequence[bool]
    ) -> list["EndEffectorAction"]:
        """Return N actions from (N, 3) and (N, 4), checked together: numpy takes as long for all as for one."""
        positions = finite_array("actions.position", positions_m, (None, 3))
        quaternions = unit_quaternions("actions.quaternion_xyzw", quaternions_xyzw, (None, 4))
        actions = [object.__new__(cls) for _ in positions]
        for action, place, turn, is_open in zip(actions, positions, quaternions, gripper_open, strict=True):
            settle(action, position_m=place, quaternion_xyzw=turn, gripper_open=is_open)
        return actions


class _Pose(NamedTuple):
    position_m: tuple[float, ...]
    quaternion_xyzw: tuple[float, ...]


class Pose(_Pose):
    """The end effector's pose: (3,) m and (4,) xyzw, in the world frame, as plain numbers that are not checked.

    Raises:
        InvalidInputError: for another number of numbers.
    """

    __slots__ = ()

    def __new__(cls, position_m: Iterable[float], quaternion_xyzw: Iterable[float]) -> "Pose":
        """Return the pose of sequences or arrays."""
        place, turn = tuple(map(float, position_m)), tuple(map(float, quaternion_xyzw))
        if (len(place), len(turn)) != (3, 4):
            valid = "3 of a position, 4 of a quaternion x y z w"
            raise InvalidInputError("pose", f"has {len(place)} and {len(turn)} numbers", valid)
        return super().__new__(cls, place, turn)

    @classmethod
    def of(cls, action: EndEffectorAction) -> "Pose":
        """Return the pose that an action goes to."""
        return cls(action.position_m.tolist(), action.quaternion_xyzw.tolist())


@dataclass(frozen=True, eq=False)
class ObjectPose:
    """An object's estimated pose in the world frame.

    Attributes:
        position_m: (3,).
        quaternion_xyzw: (4,), or None where the estimator gives no rotation.
        estimator: name of the estimator that found it.
        cameras: names of the cameras that saw it.
        confidence: 0..1, the estimator's own.
        reason: why the confidence is low, in words; else empty.
    """

    name: str
    position_m: Array
    quaternion_xyzw: Array | None = None
    estimator: str = "given"
    cameras: tuple[str, ...] = ()
    confidence: float = 1.0
    reason: str = ""

    def __post_init__(self) -> None:
        where = f"objects[{checked_object_name('objects.name', self.name)}]"
        settle(self, position_m=positions_array(f"{where}.position", self.position_m, (3,)))
        if self.quaternion_xyzw is not None:
            unit = unit_quaternions(f"{where}.quaternion_xyzw", self.quaternion_xyzw, (4,))
            settle(self, quaternion_xyzw=unit)
        if not 0 <= self.confidence <= 1:
            raise InvalidInputError(f"{where}.confidence", f"is {self.confidence}", "a number in 0..1")


def object_json(pose: ObjectPose) -> dict[str, Any]:
    """Return an object with its pose as requests have it."""
    quaternion = None if pose.quaternion_xyzw is None else pose.quaternion_xyzw.tolist()
    return {"name": pose.name, "position": pose.position_m.tolist(), "quaternion_xyzw": quaternion}


def object_from_json(item: Mapping[str, Any]) -> ObjectPose:
    """Return an object of an answer or a file: `name` and `position` are needed, the other members may be missing.

    Raises:
        InvalidInputError: for values that ObjectPose refuses.
        KeyError, TypeError, AttributeError: for a document of another form.
    """
    names = ("quaternion_xyzw", "estimator", "confidence", "reason")
    known = {name: item[name] for name in names if item.get(name) is not None}
    return ObjectPose(item["name"], item["position"], cameras=tuple(item.get("cameras") or ()), **known)
