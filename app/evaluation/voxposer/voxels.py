"""Voxels of a workspace and rotations in plain Python, for a process without numpy."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

SIZE = 100  # voxels along each axis, as published
AXES = ("x", "y", "z")
Voxel = tuple[int, int, int]
Box = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class Voxels:
    """A workspace cut into SIZE voxels along each axis.

    Attributes:
        min_m: (3,) its lower corner in the world frame.
        step_m: (3,) the size of a voxel.
    """

    min_m: tuple[float, ...]
    step_m: tuple[float, ...]

    def at(self, position_m: Sequence[float]) -> Voxel:
        """Return the voxel that contains a position; outside of the workspace the nearest one."""
        x, y, z = (
            min(max(math.floor((value - low) / step), 0), SIZE - 1)
            for value, low, step in zip(position_m, self.min_m, self.step_m, strict=True)
        )
        return x, y, z

    def center_m(self, voxel: Sequence[float]) -> tuple[float, ...]:
        """Return the center of a voxel in the world frame."""
        return tuple(
            low + (number + 0.5) * step for number, low, step in zip(voxel, self.min_m, self.step_m, strict=True)
        )

    def count(self, length_cm: float, axis: int) -> int:
        """Return the number of voxels along an axis that is nearest to a length."""
        return round(length_cm / (100 * self.step_m[axis]))

    def around(self, low: Sequence[int], high: Sequence[int], margin_cm: float) -> Box:
        """Return the box from one voxel to another (both included) with a margin, clipped to the workspace."""
        margins = [self.count(margin_cm, axis) for axis in range(3)]
        x, y, z = (
            (max(first - margin, 0), min(last + margin + 1, SIZE))
            for first, last, margin in zip(low, high, margins, strict=True)
        )
        return x, y, z


def pointing_down(yaw_deg: float, tilt_deg: float) -> tuple[float, float, float, float]:
    """Return xyzw: yaw about z, minus tilt about y, half a turn about x, so that the tool's z points down."""
    yaw, tilt = math.radians(yaw_deg) / 2, -math.radians(tilt_deg) / 2
    (cos_yaw, sin_yaw), (cos_tilt, sin_tilt) = ((math.cos(half), math.sin(half)) for half in (yaw, tilt))
    return cos_yaw * cos_tilt, sin_yaw * cos_tilt, -cos_yaw * sin_tilt, sin_yaw * sin_tilt


def turned(quaternion_xyzw: Sequence[float], vector: Sequence[float]) -> tuple[float, float, float]:
    """Rotate a vector from an object's axes to the world's."""
    x, y, z, w = quaternion_xyzw
    vx, vy, vz = vector
    # t = 2 q x v; v + w t + q x t
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def yaw_deg(quaternion_xyzw: Sequence[float]) -> float:
    """Return the heading of the x axis, seen from above."""
    x, y, _ = turned(quaternion_xyzw, (1.0, 0.0, 0.0))
    return math.degrees(math.atan2(y, x))
