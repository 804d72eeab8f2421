"""Spatial relations between objects, in the robot's frame: x forward, y left, z up.

Every relation selects from candidates, and returns several where the positions do not decide clearly. Distances are in
meters, those to the robot horizontal.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from roboprompt_client.types.arrays import Array

MARGIN_M = 0.02  # the uncertainty of poses from images; smaller differences count as equal
SAME_PLACE_M = 0.03  # horizontal distance of what rests on an object whose height is not known
CLEARLY_NEARER = 1.5  # ratio of the second nearest distance to the nearest
MOSTLY = 0.5  # share of the distance along the direction: within 60 degrees of it
ALONGSIDE = 0.35  # greatest offset from the line between two objects, as a share of its length, to be between them
Names = tuple[str, ...]
Pick = Callable[["Layout", Names], Names]
AXES: Mapping[str, tuple[int, int]] = {
    "left": (1, 1), "right": (1, -1), "far": (0, 1), "near": (0, -1), "top": (2, 1), "bottom": (2, -1),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Layout:
    """Positions (3,) of the objects by name and of the robot's base, in meters, world frame.

    Attributes:
        robot_yaw_rad: the direction in which the robot looks, from +x toward +y.
    """

    positions_m: Mapping[str, Array]
    robot_m: Array
    robot_yaw_rad: float = 0.0

    def along(self, name: str, side: str) -> float:
        """Return how far (m) an object lies from the robot toward a side, a key of `AXES`."""
        axis, sign = AXES[side]
        x_m, y_m, z_m = self.positions_m[name] - self.robot_m
        cos, sin = np.cos(self.robot_yaw_rad), np.sin(self.robot_yaw_rad)
        return float(sign * (cos * x_m + sin * y_m, cos * y_m - sin * x_m, z_m)[axis])

    def is_on(self, name: str, other: str) -> bool:
        """Return whether an object is above another within 45 degrees, or at its place and not below it."""
        x_m, y_m, above_m = self.positions_m[name] - self.positions_m[other]
        return bool(above_m > -MARGIN_M and np.hypot(x_m, y_m) < max(SAME_PLACE_M, above_m))

    def distance_m(self, name: str, other: str | None) -> float:
        """Return the distance of an object from another, or from the robot (None)."""
        if other is None:
            return float(np.linalg.norm((self.positions_m[name] - self.robot_m)[:2]))
        return float(np.linalg.norm(self.positions_m[name] - self.positions_m[other]))


def extreme(side: str, place: int = 1) -> Pick:
    """The `place`-th (from 1) of the candidates from a side."""
    return lambda layout, names: _nth(names, lambda name: -layout.along(name, side), place)


def by_distance(other: str | None, place: int = 1, *, farthest: bool = False) -> Pick:
    """The `place`-th (from 1) of the candidates by their distance from an object, or from the robot."""
    sign = -1 if farthest else 1
    return lambda layout, names: _nth(_without(names, other), lambda name: sign * layout.distance_m(name, other), place)


def next_to(other: str) -> Pick:
    """The candidate beside an object: the only other one, or clearly the nearest."""
    return lambda layout, names: _clearly_nearest(layout, _without(names, other), other)


def beyond(side: str, other: str) -> Pick:
    """The candidate on a side of an object; of several the one that is clearly nearest to it."""

    def pick(layout: Layout, names: Names) -> Names:
        def is_there(name: str) -> bool:
            offset_m = layout.along(name, side) - layout.along(other, side)
            return offset_m > max(MARGIN_M, MOSTLY * layout.distance_m(name, other))

        return _clearly_nearest(layout, tuple(filter(is_there, _without(names, other))), other)

    return pick


def resting_on(other: str) -> Pick:
    """The candidate on an object: above it, or at its place as a bowl on a flat box; of several clearly the nearest."""

    def pick(layout: Layout, names: Names) -> Names:
        found = tuple(name for name in _without(names, other) if layout.is_on(name, other))
        return _clearly_nearest(layout, found, other)

    return pick


def related(relation: str, other: str) -> Pick:
    """The candidate in a relation to an object, a value of `vocabulary.RELATIONS`."""
    picks = {"next to": next_to, "on": resting_on}
    return picks[relation](other) if relation in picks else beyond(relation, other)


def between(one: str, other: str) -> Pick:
    """The candidates on the way from one object to another."""

    def pick(layout: Layout, names: Names) -> Names:
        start_m, end_m = layout.positions_m[one], layout.positions_m[other]
        way_m = end_m - start_m
        length_m = float(np.linalg.norm(way_m))
        if length_m < MARGIN_M:
            return ()

        def is_there(name: str) -> bool:
            offset_m = layout.positions_m[name] - start_m
            share = float(offset_m @ way_m) / length_m**2
            return 0 < share < 1 and float(np.linalg.norm(offset_m - share * way_m)) < ALONGSIDE * length_m

        return tuple(filter(is_there, _without(names, one, other)))

    return pick


def on_side(side: str) -> Pick:
    """The one of two candidates on a side; of more those that lie clearly on that side of their middle."""

    def pick(layout: Layout, names: Names) -> Names:
        if len(names) <= 2:
            return extreme(side)(layout, names)
        middle = float(np.mean([layout.along(name, side) for name in names]))
        return tuple(name for name in names if layout.along(name, side) > middle + MARGIN_M)

    return pick


def in_the_middle(layout: Layout, names: Names) -> Names:
    """The middle one of an odd number of candidates, along the axis of the robot's frame on which they spread most."""
    if len(names) < 3 or len(names) % 2 == 0:
        return names
    side = max(("left", "far", "top"), key=lambda side: np.ptp([layout.along(name, side) for name in names]))
    return _nth(names, lambda name: layout.along(name, side), len(names) // 2 + 1)


def _without(names: Names, *others: str | None) -> Names:
    return tuple(name for name in names if name not in others)


def _nth(names: Names, key: Callable[[str], float], place: int) -> Names:
    """Return the name at that place (from 1) by increasing key, with all whose keys are within `MARGIN_M` of its."""
    if not 1 <= place <= len(names):
        return ()
    ordered = sorted(names, key=key)
    chosen = key(ordered[place - 1])
    return tuple(name for name in ordered if abs(key(name) - chosen) < MARGIN_M)


def _clearly_nearest(layout: Layout, names: Names, other: str) -> Names:
    ordered = tuple(sorted(names, key=lambda name: layout.distance_m(name, other)))
    if len(ordered) < 2:
        return ordered
    first_m, second_m = (layout.distance_m(name, other) for name in ordered[:2])
    return ordered[:1] if second_m >= CLEARLY_NEARER * first_m else ordered
