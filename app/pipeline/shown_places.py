"""Where demonstrations have an object, and how far an observed pose is from that."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.arrays import Array
from app.pipeline.episode import Demonstration, ObjectPose
from app.pipeline.geometry import yaw_rad
from app.pipeline.noise import MEAN_ERROR_M, MEAN_ERROR_RAD, MEAN_LENGTH

FIXED_M = 0.01  # what varies by less is the same in all demonstrations
FIXED_DEG = 3.0
FULL_TURN_DEG = 200.0  # demonstrations over more than this have an object at any angle


@dataclass(frozen=True, eq=False)
class ShownPlaces:
    """One object in all demonstrations.

    Attributes:
        number: of the demonstrations.
        low_m, high_m: (3,) the box that holds its places.
        up: (N, 3) the directions of its z axis; empty where its rotations are not known.
        yaws_rad: (N,) of the same objects.
    """

    number: int
    low_m: Array
    high_m: Array
    up: Array
    yaws_rad: Array

    @classmethod
    def of(cls, name: str, shown: Sequence[Demonstration]) -> "ShownPlaces":
        """The places of the object in at least one demonstration."""
        poses = [demonstration.object(name) for demonstration in shown]
        places_m = np.array([pose.position_m for pose in poses])
        known = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
        turns = [Rotation.from_quat(quaternion) for quaternion in known]
        up = np.array([turn.apply([0.0, 0.0, 1.0]) for turn in turns]).reshape(-1, 3)
        yaws_rad = np.array([yaw_rad(turn) for turn in turns])
        return cls(len(poses), places_m.min(axis=0), places_m.max(axis=0), up, yaws_rad)

    @property
    def range_m(self) -> Array:
        """(3,) how far the places reach along each axis."""
        reach: Array = self.high_m - self.low_m
        return reach

    def beyond_m(self, pose: ObjectPose) -> Array:
        """(3,) how far the pose lies outside of the box."""
        beyond: Array = np.maximum(pose.position_m - self.high_m, 0) + np.maximum(self.low_m - pose.position_m, 0)
        return beyond

    def lifted_m(self, pose: ObjectPose) -> float:
        """How far the pose lies above or below; 0 where demonstrations have the object at different heights."""
        return float(self.beyond_m(pose)[2]) if self.range_m[2] < FIXED_M else 0.0

    def leans_deg(self, pose: ObjectPose) -> float:
        """The angle between its z axis and that of the nearest demonstration; 0 where it is not known."""
        if pose.quaternion_xyzw is None or not len(self.up):
            return 0.0
        axis = Rotation.from_quat(pose.quaternion_xyzw).apply([0.0, 0.0, 1.0])
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
        up_z = Rotation.from_quat(pose.quaternion_xyzw).apply([0.0, 0.0, 1.0])[2]
        tilt_deg = math.degrees(math.acos(float(np.clip(up_z, -1, 1))))
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
        own_deg = float(_wrapped_deg(np.array(yaw_rad(Rotation.from_quat(pose.quaternion_xyzw)) - middle_rad)))
        return max(float(off_deg.min()) - own_deg, own_deg - float(off_deg.max()), 0.0), range_deg


def estimated_error_m(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> float:
    """The mean error of the observed positions, from heights and tilts that are the same in all demonstrations.

    Errors are taken for Gaussian, alike along every axis, with as many degrees to a centimetre as the paper's pose
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
    """The same angles from -180 to 180 degrees."""
    wrapped: Array = np.degrees((angles_rad + np.pi) % (2 * np.pi) - np.pi)
    return wrapped
