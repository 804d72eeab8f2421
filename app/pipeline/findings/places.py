"""The range of an object's poses in demonstrations, and how far an observed pose is outside of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings.arrangement import RigidPair, Side, outside_m, rigid_pairs, sides
from app.pipeline.noise import MEAN_ERROR_M, MEAN_ERROR_RAD, MEAN_LENGTH
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

UP = (0.0, 0.0, 1.0)
HAND = "the end effector"
FIXED_M = 0.01  # what varies by less is the same in all demonstrations
FIXED_DEG = 3.0
FULL_TURN_DEG = 200.0  # demonstrations that span more have the object at any angle
# A single place this far from all others is an outlier; the second value is for fewer than MANY_DEMONSTRATIONS
LONE_M, LONE_OF_FEW_M = 0.5, 1.0
MANY_DEMONSTRATIONS = 5
FEW_M, MANY = 0.5, 10  # the slack grows by FEW_M * (1/N - 1/MANY): 5 cm for five demonstrations, 12 cm for three
SLACK = 15.0  # times range / N^2: 0.15 of the range for ten demonstrations, 0.6 for five: docs/results/safety.md
MIN_DEMONSTRATIONS = 3  # fewer demonstrations show no range


class OffBox(NamedTuple):
    """How far a place is outside of a box, along the axis on which it exceeds the slack most.

    Attributes:
        far_m: the distance from the box.
        doubtful_m: the same less the slack, within which unseen places may well lie.
        range_text: the box along that axis.
    """

    axis: str
    far_m: float
    doubtful_m: float
    range_text: str


@dataclass(frozen=True, eq=False)
class ShownPlaces:
    """The places of one object, or of the hand before it moves, in all demonstrations.

    Attributes:
        number: of demonstrations.
        low_m, high_m: (3,) the bounding box of the places, without outliers.
        up: (N, 3) the directions of its z axis; empty where its rotations are not known.
        yaws_rad: (N,) its yaws.
    """

    number: int
    low_m: Array
    high_m: Array
    up: Array
    yaws_rad: Array

    @classmethod
    def of(cls, poses: Sequence[ObjectPose]) -> "ShownPlaces":
        """Return the range of at least one pose."""
        places_m = np.array([pose.position_m for pose in poses])
        known = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
        up = np.array([quaternions.rotated(turn, UP) for turn in known]).reshape(-1, 3)
        yaws_rad = np.array([quaternions.yaw_rad(turn) for turn in known])
        return cls(len(poses), *_box_m(places_m), up, yaws_rad)

    @property
    def range_m(self) -> Array:
        """(3,) the extent of the box."""
        reach: Array = self.high_m - self.low_m
        return reach

    @property
    def slack_m(self) -> Array:
        """(3,) how far outside of the box unseen places may well lie: the fewer demonstrations, the farther."""
        slack: Array = SLACK * self.range_m / self.number**2 + max(0.0, FEW_M * (1 / self.number - 1 / MANY))
        return slack

    def off_box(self, place_m: Array) -> OffBox:
        """Return how far a place (3,) is outside of the box."""
        beyond_m = outside_m(place_m, self.low_m, self.high_m)
        axis = int(np.argmax(beyond_m - self.slack_m))
        far_m, low_m, high_m = float(beyond_m[axis]), self.low_m[axis], self.high_m[axis]
        return OffBox("xyz"[axis], far_m, far_m - float(self.slack_m[axis]), f"{low_m:.3f} to {high_m:.3f} m")

    def lifted_m(self, pose: ObjectPose) -> float:
        """Return the height difference from the box; 0 if demonstrations have the object at several heights."""
        off_m = outside_m(pose.position_m, self.low_m, self.high_m)
        return float(off_m[2]) if self.range_m[2] < FIXED_M else 0.0

    def leans_deg(self, pose: ObjectPose) -> float:
        """Return the angle between its z axis and the nearest demonstrated one; 0 where one is not known."""
        if pose.quaternion_xyzw is None or not len(self.up):
            return 0.0
        axis = quaternions.rotated(pose.quaternion_xyzw, UP)
        return math.degrees(math.acos(float(np.clip((self.up @ axis).max(), -1, 1))))

    @property
    def is_upright(self) -> bool:
        """Whether its z axis is the same in all demonstrations."""
        return len(self.up) > 0 and float((self.up @ self.up.T).min()) > math.cos(math.radians(FIXED_DEG))

    def tilted_beyond_deg(self, pose: ObjectPose) -> float:
        """Return by how much its tilt from the vertical is outside of the demonstrated range."""
        if pose.quaternion_xyzw is None or not len(self.up):
            return 0.0
        tilts_deg = np.degrees(np.arccos(np.clip(self.up[:, 2], -1, 1)))
        tilt_deg = math.degrees(quaternions.tilt_rad(pose.quaternion_xyzw))
        return float(max(tilts_deg.min() - tilt_deg, tilt_deg - tilts_deg.max(), 0))

    def turned_beyond_deg(self, pose: ObjectPose) -> tuple[float, float]:
        """Return by how much its yaw is outside of the demonstrated range, and the extent of the range."""
        if pose.quaternion_xyzw is None or not len(self.yaws_rad):
            return 0.0, 0.0
        middle_rad = np.angle(np.exp(1j * self.yaws_rad).mean())
        off_deg = _wrapped_deg(self.yaws_rad - middle_rad)
        range_deg = float(np.ptp(off_deg))
        if range_deg > FULL_TURN_DEG:
            return 0.0, range_deg
        own_deg = float(_wrapped_deg(np.array(quaternions.yaw_rad(pose.quaternion_xyzw) - middle_rad)))
        return max(float(off_deg.min()) - own_deg, own_deg - float(off_deg.max()), 0.0), range_deg


def _box_m(places_m: Array) -> tuple[Array, Array]:
    """Return (3,) the least and largest coordinates of places (N, 3), without an outlier at either end.

    An outlier is farther from the others than these are from each other, and by more than an unusual place would be: it
    was recorded in another frame, or another object was found.
    """
    sorted_m = np.sort(places_m, axis=0)
    if len(sorted_m) < MIN_DEMONSTRATIONS:
        return sorted_m[0], sorted_m[-1]
    lone_m = LONE_M if len(sorted_m) >= MANY_DEMONSTRATIONS else LONE_OF_FEW_M
    above, below = (
        np.diff(sorted_m, axis=0)[gap] > np.maximum(lone_m, sorted_m[last] - sorted_m[first])
        for gap, first, last in ((-1, 0, -2), (0, 1, -1))
    )
    return np.where(below, sorted_m[1], sorted_m[0]), np.where(above, sorted_m[-2], sorted_m[-1])


@dataclass(frozen=True, eq=False)
class ShownScenes:
    """The scenes of demonstrations; what is derived from them is computed once.

    Attributes:
        left_out: demonstrations of plans that no prompt shows.
    """

    demonstrations: tuple[Demonstration, ...]
    left_out: tuple[Demonstration, ...] = ()
    _places: dict[str, ShownPlaces] = field(default_factory=dict, init=False, repr=False)
    _least_apart_m: dict[tuple[str, str], float] = field(default_factory=dict, init=False, repr=False)

    def places(self, name: str) -> ShownPlaces:
        """Return the range of the object's places."""
        if (places := self._places.get(name)) is None:
            places = self._places[name] = ShownPlaces.of([item.object(name) for item in self.demonstrations])
        return places

    @cached_property
    def starts(self) -> ShownPlaces | None:
        """The range of the hand's places before the first action; None if any is not known."""
        poses = [ObjectPose(HAND, item.start.position_m) for item in self.demonstrations if item.start is not None]
        return ShownPlaces.of(poses) if poses and len(poses) == len(self.demonstrations) else None

    @cached_property
    def pairs(self) -> tuple[RigidPair, ...]:
        """The pairs of objects that keep one arrangement."""
        return rigid_pairs(self.demonstrations)

    @cached_property
    def sides(self) -> tuple[Side, ...]:
        """The pairs of objects of which one is always on the same side of the other."""
        return sides(self.demonstrations)

    def least_apart_m(self, one: str, other: str) -> float:
        """Return the least distance between two objects in any scene."""
        if (least_m := self._least_apart_m.get((one, other))) is None:
            least_m = min(apart_m(d.object(one), d.object(other)) for d in self.demonstrations)
            self._least_apart_m[one, other] = least_m
        return least_m


def estimated_error_m(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> float:
    """Return the mean position error, estimated from heights and tilts that are equal in all demonstrations.

    The error model is Gaussian and isotropic, with the paper's ratio of rotation to position errors. Return 0 if no
    height and no tilt is equal in all.
    """
    per_axis_m, per_axis_deg = MEAN_ERROR_M / MEAN_LENGTH, math.degrees(MEAN_ERROR_RAD) / MEAN_LENGTH
    squares, number = 0.0, 0
    for pose, shown in zip(observed, places, strict=True):
        if shown.range_m[2] < FIXED_M:
            squares, number = squares + (shown.lifted_m(pose) / per_axis_m) ** 2, number + 1
        if pose.quaternion_xyzw is not None and shown.is_upright:
            squares, number = squares + (shown.leans_deg(pose) / per_axis_deg) ** 2, number + 2
    return MEAN_ERROR_M * math.sqrt(squares / number) if number else 0.0


def _wrapped_deg(angles_rad: Array) -> Array:
    wrapped: Array = np.degrees((angles_rad + np.pi) % (2 * np.pi) - np.pi)
    return wrapped


def apart_m(one: ObjectPose, other: ObjectPose) -> float:
    """Return the distance between two objects."""
    return float(np.linalg.norm(one.position_m - other.position_m))
