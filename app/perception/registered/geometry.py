"""Point clouds with one point per voxel and normals towards the camera; batches of poses."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from roboprompt_client.types.arrays import Array

Index = npt.NDArray[np.intp]
Bools = npt.NDArray[np.bool_]

VOXEL_M = 0.004
MAX_VOXELS = 2**20  # along an axis, about 4 km
NORMAL_RADIUS_M, NORMAL_NEIGHBORS = 0.015, 14


def thinned(points_m: Array, *others: Array) -> tuple[Array, ...]:
    """Return the mean point (N, 3) of each voxel, and the means (N, 3) of the points' other values (M, 3)."""
    cells = np.floor(points_m / VOXEL_M).astype(np.int64) + MAX_VOXELS // 2
    _, inverse, counts = np.unique(cells @ [1, MAX_VOXELS, MAX_VOXELS**2], return_inverse=True, return_counts=True)
    return tuple(
        np.stack([np.bincount(inverse, values[:, axis]) for axis in range(3)], axis=1) / counts[:, None]
        for values in (points_m, *others)
    )


def normals_of(points_m: Array, eyes_m: Array) -> Array:
    """Return unit normals (N, 3) of planes through each point's neighbors, towards the camera positions (N, 3)."""
    if len(points_m) < 3:
        return unit(eyes_m - points_m)
    count = min(NORMAL_NEIGHBORS, len(points_m))
    _, index = cKDTree(points_m).query(points_m, k=count, distance_upper_bound=NORMAL_RADIUS_M)
    known = (index < len(points_m))[..., None]
    near = points_m[np.minimum(index, len(points_m) - 1)]
    mean = np.where(known, near, 0).sum(axis=1, keepdims=True) / known.sum(axis=1, keepdims=True)
    offsets = np.where(known, near - mean, 0)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1][:, :, 0]
    facing = np.einsum("ni,ni->n", normals, eyes_m - points_m) < 0
    return np.where(facing[:, None], -normals, normals)


def lengths(vectors: Array) -> Array:
    """Return the lengths (...) of vectors (..., 3); several times as fast as `np.linalg.norm`."""
    result: Array = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return result


def unit(vectors: Array) -> Array:
    """Return vectors scaled to length 1; zero vectors remain zero."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    result: Array = vectors / np.maximum(lengths, 1e-12)
    return result


@dataclass(frozen=True, eq=False)
class Poses:
    """S poses, template -> world: `rotations` (S, 3, 3) and `origins_m` (S, 3)."""

    rotations: Array
    origins_m: Array

    def __len__(self) -> int:
        return len(self.rotations)

    def __getitem__(self, index: npt.ArrayLike | slice) -> "Poses":
        """Return the poses at an index array or slice."""
        return Poses(self.rotations[index], self.origins_m[index])  # type: ignore[index]

    def to_world(self, points_m: Array) -> Array:
        """Return template points (P, 3) in the world frame (S, P, 3)."""
        moved: Array = points_m @ self.rotations.transpose(0, 2, 1) + self.origins_m[:, None]
        return moved

    def to_template(self, points_m: Array) -> Array:
        """Return world points (P, 3) in the template frame (S, P, 3)."""
        moved: Array = (points_m - self.origins_m[:, None]) @ self.rotations
        return moved


def about_z(degrees: npt.ArrayLike) -> Array:
    """Return rotations (S, 3, 3) about the vertical."""
    matrices: Array = Rotation.from_euler("z", np.atleast_1d(degrees).reshape(-1, 1), degrees=True).as_matrix()
    return matrices


def angle_deg(one: Array, other: Array, symmetry_deg: float | None = None) -> float:
    """Return the least angle between rotations (3, 3) under a symmetry about z; for 0, between their z axes."""
    if symmetry_deg == 0:
        return float(np.degrees(np.arccos(np.clip(one[:, 2] @ other[:, 2], -1, 1))))
    turns = about_z(np.arange(0, 360, symmetry_deg or 360))
    traces = np.einsum("ij,tij->t", one, other @ turns)
    return float(np.degrees(np.arccos(np.clip((traces.max() - 1) / 2, -1, 1))))
