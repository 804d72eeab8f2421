"""Places of objects in demonstrations: their range, and what is constant relative to an object."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, Query
from app.pipeline.noise import MEAN_ERROR_M, MEAN_ERROR_RAD, MEAN_LENGTH
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

UP = (0.0, 0.0, 1.0)
FIXED_M = 0.01  # what varies by less is the same in all demonstrations
FIXED_DEG = 3.0
DIFFERS_DEG = 20.0  # rotations that differ by more were turned, and are no noise
FULL_TURN_DEG = 200.0  # demonstrations that span more have the object at any angle
# A single place this far from all others is an outlier; the second value is for fewer than MANY_DEMONSTRATIONS
LONE_M, LONE_OF_FEW_M = 0.5, 1.0
MANY_DEMONSTRATIONS = 5
FEW_M, MANY = 0.5, 10  # the slack grows by FEW_M * (1/N - 1/MANY): 5 cm for five demonstrations, 12 cm for three
SLACK = 15.0  # times range / N^2: 0.15 of the range for ten demonstrations, 0.6 for five: docs/results/safety.md
# Less than 10 cm it is at least 4.5 range / N: of places that are drawn evenly, one in 150 lies farther off on an axis
EVENLY, EVENLY_LESS_M = 4.5, 0.10
SPREAD_SHARE = 0.8  # of the places, which a spread counts; the others may be outliers
LEAST_OF_A_LEVEL = 2  # demonstrations that have an object at one of several heights
AT_M = 0.02  # from the nearest object's vertical axis: the hand acts at it
MIN_TURNED = 5  # demonstrations that show how hands turn with objects
MUCH_LESS = 1 / 3  # of a spread seen from another frame: the frame with the smaller one is followed
MIN_DEMONSTRATIONS = 3  # fewer demonstrations show no range


class Range(NamedTuple):
    """The range of a quantity over demonstrations: the least and the largest value, (K,) each."""

    low: Array
    high: Array

    @classmethod
    def of(cls, values: npt.ArrayLike) -> "Range":
        """Return the range of values (N, K)."""
        return cls(np.min(values, axis=0), np.max(values, axis=0))

    @property
    def width(self) -> Array:
        """(K,)."""
        width: Array = self.high - self.low
        return width

    def outside(self, value: Array) -> Array:
        """Return (K,) how far a value is outside of the range."""
        outside: Array = np.abs(value - np.clip(value, self.low, self.high))
        return outside


class OffBox(NamedTuple):
    """How far a place is outside of a box, along the axis on which it exceeds the slack most.

    Attributes:
        far_m: the distance from the box.
        beyond_slack_m: the same less the slack, within which unseen places may well lie.
        range_text: the box along that axis.
    """

    axis: str
    far_m: float
    beyond_slack_m: float
    range_text: str


@dataclass(frozen=True, eq=False)
class ShownPlaces:
    """The places of one object, or of the hand before it moves, in all demonstrations.

    Attributes:
        number: of demonstrations.
        box_m: the range of the places (3,), without outliers.
        up: (N, 3) the directions of its z axis; empty where its rotations are not known.
        yaws_rad: (N,) its yaws.
        levels_m: the ranges of its heights, see `_levels`.
    """

    number: int
    box_m: Range
    up: Array
    yaws_rad: Array
    levels_m: tuple[Range, ...]

    @classmethod
    def of(cls, poses: Sequence[ObjectPose]) -> "ShownPlaces":
        """Return the range of at least one pose."""
        places_m = np.array([pose.position_m for pose in poses])
        known = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
        up = np.array([quaternions.rotated(turn, UP) for turn in known]).reshape(-1, 3)
        yaws_rad = np.array([quaternions.yaw_rad(turn) for turn in known])
        return cls(len(poses), _box_m(places_m), up, yaws_rad, _levels(places_m[:, 2]))

    @property
    def slack_m(self) -> Array:
        """(3,) how far outside of the box unseen places may well lie: the fewer demonstrations, the farther."""
        width_m, number = self.box_m.width, self.number
        slack_m = SLACK * width_m / number**2 + max(0.0, FEW_M * (1 / number - 1 / MANY))
        evenly_m: Array = EVENLY * width_m / number - EVENLY_LESS_M
        return np.maximum(slack_m, evenly_m)

    @property
    def in_one_place(self) -> bool:
        """Whether many demonstrations have it in one place."""
        return self.number >= MANY_DEMONSTRATIONS and bool(self.box_m.width.max() < FIXED_M)

    def off_box(self, place_m: Array) -> OffBox:
        """Return how far a place (3,) is outside of the box."""
        beyond_m = self.box_m.outside(place_m)
        axis = int(np.argmax(beyond_m - self.slack_m))
        far_m, low_m, high_m = float(beyond_m[axis]), self.box_m.low[axis], self.box_m.high[axis]
        return OffBox("xyz"[axis], far_m, far_m - float(self.slack_m[axis]), f"{low_m:.3f} to {high_m:.3f} m")

    def lifted_m(self, pose: ObjectPose) -> float:
        """Return the difference from the nearest height of the demonstrations; 0 if they have it at any height."""
        return min((float(level.outside(pose.position_m[2])) for level in self.levels_m), default=0.0)

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

    def lacks_rotation(self, pose: ObjectPose) -> bool:
        """Whether its rotation is exactly the identity, though no demonstration's is and they clearly differ.

        Estimators that see no rotation say so.
        """
        if not len(self.up) or pose.quaternion_xyzw is None or not quaternions.is_identity(pose.quaternion_xyzw):
            return False
        apart = (self.up @ self.up.T).min() < math.cos(math.radians(DIFFERS_DEG))
        known_before = ((np.abs(self.yaws_rad) < quaternions.EXACTLY) & (self.up[:, 2] > 1 - quaternions.EXACTLY)).any()
        return not known_before and bool(apart or self._yaws_deg().width > DIFFERS_DEG)

    def tilted_beyond_deg(self, pose: ObjectPose) -> float:
        """Return by how much its tilt from the vertical is outside of the demonstrated range."""
        if pose.quaternion_xyzw is None or not len(self.up):
            return 0.0
        tilts_deg = np.degrees(np.arccos(np.clip(self.up[:, 2], -1, 1)))
        tilt_deg = np.degrees(quaternions.tilt_rad(pose.quaternion_xyzw))
        return float(Range.of(tilts_deg).outside(tilt_deg))

    def turned_beyond_deg(self, pose: ObjectPose) -> tuple[float, float]:
        """Return by how much its yaw is outside of the demonstrated range, and the extent of the range."""
        if pose.quaternion_xyzw is None or not len(self.yaws_rad):
            return 0.0, 0.0
        shown_deg = self._yaws_deg()
        own_deg = _wrapped_deg(np.array(quaternions.yaw_rad(pose.quaternion_xyzw) - self._middle_rad))
        beyond_deg = 0.0 if shown_deg.width > FULL_TURN_DEG else float(shown_deg.outside(own_deg))
        return beyond_deg, float(shown_deg.width)

    def _yaws_deg(self) -> Range:
        return Range.of(_wrapped_deg(self.yaws_rad - self._middle_rad))

    @property
    def _middle_rad(self) -> float:
        return float(np.angle(np.exp(1j * self.yaws_rad).mean()))


def _levels(heights_m: Array) -> tuple[Range, ...]:
    """Return the ranges of heights (N,) of an object that has one height, or a few, as on the table or on a block.

    Empty where some demonstrations have it at a height of their own, so that any may be right.
    """
    ordered = np.sort(heights_m)
    levels = np.split(ordered, np.flatnonzero(np.diff(ordered) > FIXED_M) + 1)
    ranges = tuple(Range.of(level) for level in levels)
    alone = len(levels) > 1 and min(len(level) for level in levels) < LEAST_OF_A_LEVEL
    return () if alone or any(found.width >= FIXED_M for found in ranges) else ranges


def _box_m(places_m: Array) -> Range:
    """Return the range of places (N, 3), without an outlier at either end of an axis.

    An outlier is farther from the others than these are from each other, and by more than an unusual place would be: it
    was recorded in another frame, or another object was found.
    """
    sorted_m = np.sort(places_m, axis=0)
    if len(sorted_m) < MIN_DEMONSTRATIONS:
        return Range.of(places_m)
    lone_m = LONE_M if len(sorted_m) >= MANY_DEMONSTRATIONS else LONE_OF_FEW_M
    above, below = (
        np.diff(sorted_m, axis=0)[gap] > np.maximum(lone_m, sorted_m[last] - sorted_m[first])
        for gap, first, last in ((-1, 0, -2), (0, 1, -1))
    )
    return Range(np.where(below, sorted_m[1], sorted_m[0]), np.where(above, sorted_m[-2], sorted_m[-1]))


def estimated_error_m(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> float:
    """Return the mean position error, estimated from heights and tilts that are equal in all demonstrations.

    The error model is Gaussian and isotropic, with the paper's ratio of rotation to position errors. Return 0 if no
    height and no tilt is equal in all.
    """
    per_axis_m, per_axis_deg = MEAN_ERROR_M / MEAN_LENGTH, math.degrees(MEAN_ERROR_RAD) / MEAN_LENGTH
    squares, number = 0.0, 0
    for pose, shown in zip(observed, places, strict=True):
        if shown.box_m.width[2] < FIXED_M:
            squares, number = squares + (shown.lifted_m(pose) / per_axis_m) ** 2, number + 1
        if pose.quaternion_xyzw is not None and shown.is_upright:
            squares, number = squares + (shown.leans_deg(pose) / per_axis_deg) ** 2, number + 2
    return MEAN_ERROR_M * math.sqrt(squares / number) if number else 0.0


def _wrapped_deg(angles_rad: Array) -> Array:
    wrapped: Array = np.degrees((angles_rad + np.pi) % (2 * np.pi) - np.pi)
    return wrapped


def places_by_object(scenes: Sequence[Query], places_m: Array) -> dict[tuple[str, str], Array]:
    """Return places (N, 3) of N scenes relative to each object that all have, by its role and the axes.

    The role is its name, or its place in the instruction, as `<0>`. Axes are the world's (`w`), or the object's own
    (`o`) where all its rotations are known.
    """
    by_role = [{scene.order.placeholder(pose.name): pose for pose in scene.objects} for scene in scenes]
    found: dict[tuple[str, str], Array] = {}
    for role in by_role[0]:
        poses = [scene[role] for scene in by_role if role in scene]
        if len(poses) < len(scenes):
            continue
        found[role, "w"] = places_m - np.array([pose.position_m for pose in poses])
        turned = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
        if len(turned) == len(scenes):
            found[role, "o"] = Rotation.from_quat(np.array(turned)).inv().apply(found[role, "w"])
    return found


def spread_m(places_m: Array) -> float:
    """Return the distance from their median within which most of the places (N, 3) lie."""
    return float(np.quantile(np.linalg.norm(places_m - np.median(places_m, axis=0), axis=1), SPREAD_SHARE))


def beside_m(places_m: Array, shown: Demonstration) -> Array:
    """Return (K,) the horizontal distance of each of K places from the nearest object."""
    objects_m = np.array([pose.position_m for pose in shown.objects])
    distances_m: Array = np.linalg.norm(places_m[:, None, :2] - objects_m[None, :, :2], axis=2).min(axis=1)
    return distances_m
