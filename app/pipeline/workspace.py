"""The workspace and its bins: continuous poses <-> the integers that the LLM reads and writes (paper, section III-C).

100 position bins an axis and 72 rotation bins of 5 degrees, after PerAct (arXiv 2209.05451). A rotation is three
extrinsic (fixed-axis) xyz Euler angles.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, finite_array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

POSITION_BINS = 100
ROTATION_BINS = 72
ROTATION_BIN_DEG = 360 / ROTATION_BINS
EDGE_TO_LOWER_BIN = 1e-12  # added to the bin size, as in PerAct: an exact edge falls into the lower bin
# RLBench's scene bounds, also used by the authors' code (paper, appendix "Simulation setup")
RLBENCH_MIN_M = (-0.3, -0.5, 0.6)
RLBENCH_MAX_M = (0.7, 0.5, 1.6)
# A workspace that follows from demonstrations: unseen scenes reach somewhat beyond them, and one demonstration says
# little about how far; a meter is what RLBench's box measures, so that bins are as fine.
AUTO_MARGIN_M, AUTO_MARGIN_BELOW_M = 0.10, 0.05
AUTO_LEAST_M = 1.0
AUTO_GRID_M = 0.05
MAX_GROWTH = 2.0  # of an edge by less than half of the demonstrations; beyond it they are left apart


@dataclass(frozen=True, eq=False)
class Workspace:
    """The axis-aligned box, in meters in the world frame, that the position bins divide.

    Attributes:
        min_m, max_m: (3,) opposite corners.
    """

    min_m: Array
    max_m: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "min_m", finite_array("workspace.min", self.min_m, (3,)))
        object.__setattr__(self, "max_m", finite_array("workspace.max", self.max_m, (3,)))
        if (self.max_m <= self.min_m).any():
            low, high = self.min_m.tolist(), self.max_m.tolist()
            raise InvalidInputError("workspace", f"min {low} is not below max {high}", "min < max on every axis")
        with np.errstate(over="ignore"):
            bounded = np.isfinite(self.max_m - self.min_m).all()
        if not bounded:  # there are no bins of infinite size
            low, high = self.min_m.tolist(), self.max_m.tolist()
            raise InvalidInputError("workspace", f"min {low} and max {high} are too far apart", "a box of finite size")

    @classmethod
    def rlbench(cls) -> "Workspace":
        """RLBench's scene bounds, the default."""
        return cls(np.array(RLBENCH_MIN_M), np.array(RLBENCH_MAX_M))

    @classmethod
    def of_demonstrations(cls, places_m: Sequence[Array]) -> "Workspace":
        """The box that demonstrations span, those left apart that reach far beyond the others; RLBench's without any.

        Args:
            places_m: for each demonstration, oldest first, (N, 3) positions of the hand and of the objects.
        """
        if not places_m:
            return cls.rlbench()
        ends_m = (np.array([end(each, axis=0) for each in places_m]) for end in (np.min, np.max))
        box: Workspace | None = None
        for number in sorted(_majority(*ends_m)):
            box = cls.around(places_m[number], box)
        assert box is not None
        return box

    @classmethod
    def around(cls, positions_m: Array, grown_from: "Workspace | None" = None) -> "Workspace":
        """The box for demonstrated positions (N, 3): with a margin, rounded outwards, at least a meter wide.

        Args:
            grown_from: a box that it contains as well.
        """
        low_m, high_m = positions_m.min(axis=0), positions_m.max(axis=0)
        low_m, high_m = low_m - AUTO_MARGIN_M, high_m + AUTO_MARGIN_M
        low_m[2] += AUTO_MARGIN_M - AUTO_MARGIN_BELOW_M  # what carries the lowest object is right below it
        if grown_from is not None:  # which has room to spare: it grows by no more than what it does not hold
            low_m, high_m = np.minimum(low_m, grown_from.min_m), np.maximum(high_m, grown_from.max_m)
        missing_m = np.maximum(AUTO_LEAST_M - (high_m - low_m), 0)
        low_m[:2] -= missing_m[:2] / 2
        high_m += missing_m * (0.5, 0.5, 1.0)
        grid = AUTO_GRID_M
        return cls(np.round(np.floor(low_m / grid + 1e-9) * grid, 9), np.round(np.ceil(high_m / grid - 1e-9) * grid, 9))

    @property
    def bin_size_m(self) -> Array:
        """(3,) the size of a position bin along each axis."""
        size: Array = (self.max_m - self.min_m) / POSITION_BINS
        return size

    def contains(self, position_m: Array) -> bool:
        """Whether a position (3,) lies inside the box."""
        return bool(((position_m >= self.min_m) & (position_m <= self.max_m)).all())


def _majority(low_m: Array, high_m: Array) -> set[int]:
    """Return which demonstrations are left, those apart without which an edge is less than half as long.

    More than half are left: of two demonstrations nobody can say which one is the odd one.

    Args:
        low_m, high_m: (D, 3) corners of each demonstration.
    """

    def edges_m(chosen: npt.NDArray[np.int_]) -> Array:
        edges: Array = np.maximum(high_m[chosen].max(axis=0) - low_m[chosen].min(axis=0), AUTO_LEAST_M)
        return edges

    kept = np.arange(len(low_m))
    while (edges_m(kept) > MAX_GROWTH * AUTO_LEAST_M).any():
        by_reach = [kept[np.argsort(ends_m[kept], kind="stable")] for ends_m in (*high_m.T, *-low_m.T)]
        fewer = [order[:-number] for number in range(1, len(kept) - len(low_m) // 2) for order in by_reach]
        smaller = [rest for rest in fewer if (edges_m(kept) > MAX_GROWTH * edges_m(rest)).any()]
        if not smaller:
            break
        kept = smaller[0]
    return set(kept.tolist())


@dataclass(frozen=True)
class DiscreteAction:
    """An action as integers: x, y, z bins (0..99), roll, pitch, yaw bins (0..71), gripper (1 = open).

    Attributes:
        clamped: the position lay outside the workspace and was moved to its edge.
    """

    bins: tuple[int, ...]
    clamped: bool = False


def position_bins(positions_m: npt.ArrayLike, workspace: Workspace) -> npt.NDArray[np.int_]:
    """The bins (..., 3), each 0..99, of positions (..., 3) in the world frame; outside the workspace the nearest."""
    raw = np.floor((np.asarray(positions_m) - workspace.min_m) / (workspace.bin_size_m + EDGE_TO_LOWER_BIN))
    return np.clip(raw, 0, POSITION_BINS - 1).astype(int)


def bin_center(bins: npt.ArrayLike, workspace: Workspace) -> Array:
    """The positions (..., 3) in meters at the centers of position bins (..., 3)."""
    center: Array = workspace.min_m + (np.asarray(bins) + 0.5) * workspace.bin_size_m
    return center


def rotation_bins(rotations: Rotation) -> npt.NDArray[np.int_]:
    """The bins (..., 3), each 0..71, of rotations' extrinsic xyz Euler angles; rounds half to even, bin 72 is bin 0."""
    euler_deg = rotations.as_euler("xyz", degrees=True, suppress_warnings=True)
    bins: npt.NDArray[np.int_] = np.rint((euler_deg + 180) / ROTATION_BIN_DEG).astype(int) % ROTATION_BINS
    return bins


def rotation_from_bins(bins: npt.ArrayLike) -> Rotation:
    """The rotations whose extrinsic xyz Euler angles rotation bins (..., 3) stand for."""
    return Rotation.from_euler("xyz", np.asarray(bins) * ROTATION_BIN_DEG - 180, degrees=True)


def yaw_bin(yaw_rad: float) -> int:
    """The bin (0..71) of an angle about the vertical."""
    return round((math.degrees(yaw_rad) + 180) / ROTATION_BIN_DEG) % ROTATION_BINS


def discretize_actions(actions: Sequence[EndEffectorAction], workspace: Workspace) -> list[DiscreteAction]:
    """The actions' seven bins each."""
    if not actions:
        return []
    positions_m = np.array([action.position_m for action in actions])
    inside: list[bool] = np.all((positions_m >= workspace.min_m) & (positions_m <= workspace.max_m), axis=1).tolist()
    positions = position_bins(positions_m, workspace).tolist()
    rotations = rotation_bins(Rotation.from_quat([action.quaternion_xyzw for action in actions])).tolist()
    return [
        DiscreteAction((*place, *turn, int(action.gripper_open)), clamped=not within)
        for action, place, turn, within in zip(actions, positions, rotations, inside, strict=True)
    ]


def undiscretize_actions(bins: Sequence[Sequence[int]], workspace: Workspace) -> list[EndEffectorAction]:
    """The actions at the centers of seven bins each."""
    if not bins:
        return []
    numbers = np.array(bins)
    positions_m = bin_center(numbers[:, :3], workspace)
    quaternions_xyzw = rotation_from_bins(numbers[:, 3:6]).as_quat(canonical=True)
    return EndEffectorAction.many(positions_m, quaternions_xyzw, numbers[:, 6].astype(bool).tolist())


def object_bins(pose: ObjectPose, workspace: Workspace) -> tuple[int, ...]:
    """An object's three position bins, followed by three rotation bins where its rotation is known."""
    position = position_bins(pose.position_m, workspace).tolist()
    if pose.quaternion_xyzw is None:
        return tuple(position)
    return (*position, *rotation_bins(Rotation.from_quat(pose.quaternion_xyzw)).tolist())
