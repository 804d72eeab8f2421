"""The path of the hand as a few poses, and its deviation from straight motion.

Distances are in units of the tolerances: 1 is the tolerance in meters or that in degrees, whichever is reached first.
A reversal counts as a deviation, too: a stroke to and fro stays on one line, but is no single motion.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from roboprompt_client.types.arrays import Array
from roboprompt_client.types.trajectory import Trajectory

TOLERANCE_M = 0.01
TOLERANCE_DEG = 15.0
SPACING = 0.25  # of the poses that represent a path, in tolerances
MAX_POSES = 160  # that represent a path; a longer path has wider spacing
MAX_DEVIATION = 6.0  # larger deviations are clipped
LOOK_AHEAD = 32  # poses whose deviations are computed in one batch
NO_TURN = 0.05  # rotations below this, in tolerances, are ignored
TURNS = 10  # full turns of the hand in either direction that are unwound
MOST_TURN_DEG = 150.0  # an arm turns by the shorter way, which noise decides near half a turn
MIN_SEGMENT = 2.0  # in tolerances: on a shorter segment progress is measured by path length

Indices = npt.NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class HandPath:
    """Poses at some frames of a trajectory.

    Attributes:
        frames: (N,) ascending.
        positions: (N, 3) in tolerances.
        rotation_vectors: (N, 3) relative to the first pose, in tolerances; unwound beyond half a turn.
        most_turn: largest turn of one motion, in tolerances, if its direction matters; else infinite.
    """

    frames: Indices
    positions: Array
    rotation_vectors: Array
    most_turn: float

    @classmethod
    def between(
        cls, trajectory: Trajectory, first: int, last: int, tolerance_m: float, tolerance_deg: float, *, held: bool
    ) -> "HandPath":
        """Return the hand's path from frame `first` to frame `last`; a rest is one pose.

        Args:
            held: whether the hand holds something: then the direction of a turn matters.
        """
        part = slice(first, last + 1)
        positions: Array = trajectory.positions_m[part] / tolerance_m
        rotations = Rotation.from_quat(trajectory.quaternions_xyzw[part])
        vectors = _unwound((rotations[0].inv() * rotations).as_rotvec()) * math.degrees(1 / tolerance_deg)
        spacing = SPACING
        while len(kept := _apart(positions, vectors, spacing)) > MAX_POSES:
            spacing *= 1.5
        most_turn = MOST_TURN_DEG / tolerance_deg if held else math.inf
        return cls(kept + first, positions[kept], vectors[kept], most_turn)

    @cached_property
    def deviations(self) -> Array:
        """(N, N): the deviation of the path from pose i to j from straight motion; 0 for j <= i + 1."""
        number = len(self.frames)
        found = np.full((number, number), MAX_DEVIATION)
        np.fill_diagonal(found, 0.0)
        for i in range(number - 1):
            found[i, i + 1] = 0.0
            for start in range(i + 2, number, LOOK_AHEAD):
                ends = slice(start, min(start + LOOK_AHEAD, number))
                found[i, ends] = self._deviations_from(i, ends)
                if found[i, ends].min() >= MAX_DEVIATION:
                    break
        return found

    @cached_property
    def bend(self) -> float:
        """The deviation of the whole path from straight motion from its first pose to its last."""
        last = len(self.frames) - 1
        return float(self._deviations_from(0, slice(last, last + 1))[0]) if last > 1 else 0.0

    @property
    def turns_round(self) -> bool:
        """Whether the hand turns by more than one motion may."""
        return float(np.linalg.norm(self.rotation_vectors - self.rotation_vectors[0], axis=1).max()) > self.most_turn

    @cached_property
    def _turns(self) -> bool:
        """Whether it turns at all."""
        return bool(np.abs(self.rotation_vectors).max() > NO_TURN)

    @cached_property
    def _traveled(self) -> Array:
        """(N,) the path length up to each pose."""
        poses = np.concatenate([self.positions, self.rotation_vectors], axis=1)
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses, axis=0), axis=1))])

    def _deviations_from(self, i: int, ends: slice) -> Array:
        """Return the deviations (E,) of the segments from pose `i` to each of `ends`."""
        between, traveled = slice(i + 1, ends.stop - 1), self._traveled
        way, gone = self.positions[ends] - self.positions[i], self.positions[between] - self.positions[i]
        length = np.einsum("ek,ek->e", way, way)[:, None]
        along = (gone @ way.T).T / np.maximum(length, 1e-12)  # (E, B)
        by_travel = (traveled[between] - traveled[i]) / np.maximum(traveled[ends] - traveled[i], 1e-12)[:, None]
        progress = np.clip(np.where(length < MIN_SEGMENT**2, by_travel, along), 0, 1)
        squared = np.maximum(_squared_distances(gone, progress, way), length * _gone_back(progress) ** 2)
        if self._turns:
            turn = self.rotation_vectors[ends] - self.rotation_vectors[i]
            turned = self.rotation_vectors[between] - self.rotation_vectors[i]
            squared = np.maximum(squared, _squared_distances(turned, progress, turn))
            squared[np.linalg.norm(turn, axis=1) > self.most_turn, 0] = MAX_DEVIATION**2
        squared *= np.tri(len(way), len(gone), ends.start - i - 2)  # poses before each end
        farthest: Array = np.minimum(np.sqrt(squared.max(axis=1)), MAX_DEVIATION)
        return farthest


def _squared_distances(gone: Array, progress: Array, way: Array) -> Array:
    """(E, B) of points `gone` (B, 3) from the shares `progress` (E, B) of `way` (E, 3)."""
    off = gone.T[:, None] - progress * way.T[:, :, None]  # (3, E, B): numpy adds up rows of three several times slower
    squared: Array = (off * off).sum(axis=0)
    return squared


def _gone_back(progress: Array) -> Array:
    """Return (..., B): the distance of progress from the nearest monotonic one, half of each reversal."""
    back: Array = (np.maximum.accumulate(progress, axis=-1) - progress) / 2
    return back


def off_line_m(positions_m: Array) -> float:
    """Return the largest distance of positions (N, 3) from straight motion from the first to the last."""
    way_m = positions_m[-1] - positions_m[0]
    gone_m = positions_m - positions_m[0]
    length_m2 = float(way_m @ way_m)
    progress = np.clip(gone_m @ way_m / max(length_m2, 1e-12), 0, 1)
    beside_m = np.linalg.norm(gone_m - progress[:, None] * way_m, axis=1)
    return float(np.maximum(beside_m, length_m2**0.5 * _gone_back(progress)).max())


def _unwound(vectors_rad: Array) -> Array:
    """Return the rotation vectors (N, 3) unwound: each the equivalent one that is nearest to the one before."""
    if len(vectors_rad) < 2 or np.linalg.norm(np.diff(vectors_rad, axis=0), axis=1).max() < math.pi:
        return vectors_rad
    found = vectors_rad.copy()
    for k in range(1, len(found)):
        before, here = found[k - 1], vectors_rad[k]
        turned_rad = np.linalg.norm(here)
        axis = before if turned_rad < 1 else here * np.sign(here @ before)  # a small turn has no clear axis
        whole_rad = 2 * math.pi * axis / max(float(np.linalg.norm(axis)), 1e-12)
        alike = here + np.arange(-TURNS, TURNS + 1)[:, None] * whole_rad
        found[k] = alike[int(np.linalg.norm(alike - before, axis=1).argmin())]
    return found


def _apart(positions: Array, vectors: Array, spacing: float) -> Indices:
    """Return the indices of poses at least `spacing` apart from the one before, with the first and the last.

    It stops at `MAX_POSES`.
    """
    poses = np.stack([positions.T, vectors.T])  # (2, 3, N): sums over three run along the last axis
    kept = [0]
    last = len(positions) - 1
    while kept[-1] < last and len(kept) <= MAX_POSES:
        here = poses[:, :, kept[-1], None]
        for start in range(kept[-1] + 1, last + 1, 64):
            off = poses[:, :, start : start + 64] - here
            off *= off
            far = np.sqrt(off.sum(axis=1).max(axis=0)) >= spacing
            if far[first := int(far.argmax())]:
                kept.append(start + first)
                break
        else:
            break
    if kept[-1] != last:
        kept = [*kept[:-1], last] if len(kept) > 1 else [0, last]
    return np.array(kept)
