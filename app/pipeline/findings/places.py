"""Where demonstrations have an object, and how far an observed pose is from that."""

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
FULL_TURN_DEG = 200.0  # demonstrations over more than this have an object at any angle
LONE_M, LONE_OF_FEW_M = 0.5, 1.0  # from all others, of at least MANY_DEMONSTRATIONS demonstrations and of fewer
MANY_DEMONSTRATIONS = 5
FEW_M, MANY = 0.5, 10  # what fewer than MANY leave open besides: 5 cm of five, 12 cm of three
SLACK = 15.0  # 0.15 of the range beyond ten demonstrations, 0.6 of it beyond five: docs/results/safety.md
MIN_DEMONSTRATIONS = 3  # from which on their places say something about what was taught


class OffBox(NamedTuple):
    """How far a place is outside of a box, along the axis where that is most doubtful.

    Attributes:
        doubtful_m: less than `far_m` by how far beyond the box unseen places may well lie.
        range_text: the box along that axis.
    """

    axis: str
    far_m: float
    doubtful_m: float
    range_text: str


@dataclass(frozen=True, eq=False)
class ShownPlaces:
    """One object, or the hand before it moves, in all demonstrations.

    Attributes:
        number: of the demonstrations.
        low_m, high_m: (3,) the box that holds its places, without the coordinate of one that is far from all others.
        up: (N, 3) the directions of its z axis; empty where its rotations are not known.
        yaws_rad: (N,) of the same objects.
    """

    number: int
    low_m: Array
    high_m: Array
    up: Array
    yaws_rad: Array

    @classmethod
    def of(cls, poses: Sequence[ObjectPose]) -> "ShownPlaces":
        """The places of an object in at least one demonstration."""
        places_m = np.array([pose.position_m for pose in poses])
        known = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
        up = np.array([quaternions.rotated(turn, UP) for turn in known]).reshape(-1, 3)
        yaws_rad = np.array([quaternions.yaw_rad(turn) for turn in known])
        return cls(len(poses), *_box_m(places_m), up, yaws_rad)

    @property
    def range_m(self) -> Array:
        """(3,) how far the places reach along each axis."""
        reach: Array = self.high_m - self.low_m
        return reach

    @property
    def slack_m(self) -> Array:
        """(3,) how far beyond the box unseen places may well lie: few demonstrations tell little of where it ends."""
        slack: Array = SLACK * self.range_m / self.number**2 + max(0.0, FEW_M * (1 / self.number - 1 / MANY))
        return slack

    def off_box(self, place_m: Array) -> OffBox:
        """How far a place (3,) lies outside of the box."""
        beyond_m = outside_m(place_m, self.low_m, self.high_m)
        axis = int(np.argmax(beyond_m - self.slack_m))
        far_m, low_m, high_m = float(beyond_m[axis]), self.low_m[axis], self.high_m[axis]
        return OffBox("xyz"[axis], far_m, far_m - float(self.slack_m[axis]), f"{low_m:.3f} to {high_m:.3f} m")

    def lifted_m(self, pose: ObjectPose) -> float:
        """How far the pose lies above or below; 0 where demonstrations have the object at different heights."""
        off_m = outside_m(pose.position_m, self.low_m, self.high_m)
        return float(off_m[2]) if self.range_m[2] < FIXED_M else 0.0

    def leans_deg(self, pose: ObjectPose) -> float:
        """The angle between its z axis and that of the nearest demonstration; 0 where it is not known."""
        if pose.quaternion_xyzw is None or not len(self.up):
            return 0.0
        axis = quaternions.rotated(pose.quaternion_xyzw, UP)
        return math.degrees(math.acos(float(np.clip((self.up @ axis).max(), -1, 1))))

    @property
    def is_upright(self) -> bool:
        """Whether its z axis is the same in all demonstrations."""
        return len(self.up) > 0 and float((self.up @ self.up.T).min()) > math.cos(math.radians(FIXED_DEG))

    def tilted_beyond_deg(self, pose: ObjectPose) -> float:
        """How far the object is tilted from the vertical beyond, or short of, every demonstration."""
        if pose.quaternion_xyzw is None or not len(self.up):
            return 0.0
        tilts_deg = np.degrees(np.arccos(np.clip(self.up[:, 2], -1, 1)))
        tilt_deg = math.degrees(quaternions.tilt_rad(pose.quaternion_xyzw))
        return float(max(tilts_deg.min() - tilt_deg, tilt_deg - tilts_deg.max(), 0))

    def turned_beyond_deg(self, pose: ObjectPose) -> tuple[float, float]:
        """How far the object is turned about the vertical beyond the demonstrations, and their range."""
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
    """(3,) the least and largest coordinates of places (N, 3).

    One demonstration does not widen them where it is farther from the others than these are from each other, and by
    more than a slip or an unusual place is: it was recorded elsewhere, or its object was taken for another.
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
    """The scenes of demonstrations; what they say of an object is computed once."""

    demonstrations: tuple[Demonstration, ...]
    left_out: tuple[Demonstration, ...] = ()  # of plans that no prompt shows
    _places: dict[str, ShownPlaces] = field(default_factory=dict, init=False, repr=False)
    _least_apart_m: dict[tuple[str, str], float] = field(default_factory=dict, init=False, repr=False)

    def places(self, name: str) -> ShownPlaces:
        """Where the object is in all of them, at least one."""
        if (places := self._places.get(name)) is None:
            places = self._places[name] = ShownPlaces.of([item.object(name) for item in self.demonstrations])
        return places

    @cached_property
    def starts(self) -> ShownPlaces | None:
        """Where the hand is before the first action; None where some demonstration does not know it."""
        poses = [ObjectPose(HAND, item.start.position_m) for item in self.demonstrations if item.start is not None]
        return ShownPlaces.of(poses) if poses and len(poses) == len(self.demonstrations) else None

    @cached_property
    def pairs(self) -> tuple[RigidPair, ...]:
        """The objects that keep one arrangement."""
        return rigid_pairs(self.demonstrations)

    @cached_property
    def sides(self) -> tuple[Side, ...]:
        """The objects that stand on one side of each other."""
        return sides(self.demonstrations)

    def least_apart_m(self, one: str, other: str) -> float:
        """The least distance between two objects in any of them."""
        if (least_m := self._least_apart_m.get((one, other))) is None:
            least_m = min(apart_m(d.object(one), d.object(other)) for d in self.demonstrations)
            self._least_apart_m[one, other] = least_m
        return least_m


def estimated_error_m(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> float:
    """The mean error of the observed positions, from heights and tilts that are the same in all demonstrations.

    Errors are taken for Gaussian, alike along every axis, with as many degrees to a centimeter as the paper's pose
    estimator has; 0 where no height and no tilt is the same in all.
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
    """The distance between two objects."""
    return float(np.linalg.norm(one.position_m - other.position_m))
