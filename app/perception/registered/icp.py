"""Poses in batches, and their robust iterative closest points (ICP): point to plane, with a little point to point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.perception.registered.depth_view import Index
from app.perception.registered.template import LAB_AS_M, Template
from roboprompt_client.types.arrays import Array

MAX_TURN_RAD = 0.2  # per step
POINT_TO_POINT, POINT_TO_POINT_COLORED = 0.02, 0.06  # weight relative to point to plane; prevents sliding
DAMPING_RAD2, DAMPING_M2 = 1e-4, 1e-2
# Free components of (3,) rotation and (3,) translation: of an upright object, of any
UPRIGHT, ALL_FREE = (2, 3, 4, 5), (0, 1, 2, 3, 4, 5)
# Reaches, one per step: points farther from the template have no weight.
COARSE_M = (0.05, 0.04, 0.03, 0.03, 0.025, 0.025, 0.02, 0.02)
FINE_M = (0.02, 0.02, 0.015, 0.015, 0.012)
FINAL_M = (0.012, 0.01, 0.01)


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


def icp(
    template: Template,
    poses: Poses,
    points_m: Array,
    reaches_m: Sequence[float],
    *,
    lab: Array | None = None,
    free: Sequence[int] = UPRIGHT,
) -> Poses:
    """Return the poses after ICP steps that move the scene's points (P, 3) onto the template, one step per reach.

    Args:
        reaches_m: see `COARSE_M`.
        lab: (P, 3) colors of the points; if given, partners are the nearest by place and color.
        free: the components of (3,) rotation and (3,) translation that may change.
    """
    beside = POINT_TO_POINT if lab is None else POINT_TO_POINT_COLORED
    free = list(free)
    damping = np.diag([DAMPING_RAD2 if column < 3 else DAMPING_M2 for column in free])
    for reach_m in reaches_m:
        places_m = poses.to_template(points_m)
        partners = _partners(template, places_m, lab)
        offsets_m, normals = places_m - template.points_m[partners], template.normals[partners]
        weights = np.clip(1 - np.einsum("spi,spi->sp", offsets_m, offsets_m) / reach_m**2, 0, None) ** 2
        to_plane = _columns(places_m, normals, free)
        weighted = to_plane * weights[..., None]
        to_point, point_rhs = _to_points(places_m, offsets_m, beside * weights)
        lhs = weighted.transpose(0, 2, 1) @ to_plane + to_point[:, free][:, :, free] + damping
        along_m = np.einsum("spi,spi->sp", offsets_m, normals)
        rhs = np.einsum("spi,sp->si", weighted, along_m) + point_rhs[:, free]
        step = np.zeros((len(poses), 6))  # of the scene in the template's frame
        step[:, free] = -np.linalg.solve(lhs, rhs[..., None])[..., 0]
        turns = Rotation.from_rotvec(np.clip(step[:, :3], -MAX_TURN_RAD, MAX_TURN_RAD)).as_matrix()
        rotations = poses.rotations @ turns.transpose(0, 2, 1)
        poses = Poses(rotations, poses.origins_m - np.einsum("sij,sj->si", rotations, step[:, 3:]))
    return poses


def _partners(template: Template, places_m: Array, lab: Array | None) -> Index:
    """Return the index (S, P) of each point's partner in the template."""
    if lab is None:
        return template.closest(places_m)
    colored = np.concatenate([places_m, np.broadcast_to(lab * LAB_AS_M, places_m.shape)], axis=2)
    partners: Index = template.tree.query(colored.reshape(-1, 6))[1].reshape(places_m.shape[:2])
    return partners


def _columns(places_m: Array, normals: Array, free: Sequence[int]) -> Array:
    """Return the derivatives (S, P, F) of points' offsets along normals by the free components."""
    x, n = np.moveaxis(places_m, -1, 0), np.moveaxis(normals, -1, 0)
    turns = [x[(k + 1) % 3] * n[(k + 2) % 3] - x[(k + 2) % 3] * n[(k + 1) % 3] for k in free if k < 3]
    return np.stack([*turns, *(n[k - 3] for k in free if k >= 3)], axis=-1)


def _to_points(places_m: Array, offsets_m: Array, weights: Array) -> tuple[Array, Array]:
    """Return the normal equations (S, 6, 6) and (S, 6) that move points (S, P, 3) by their weighted offsets.

    The unknowns are (3,) rotation and (3,) translation.
    """
    lhs, rhs = np.zeros((len(places_m), 6, 6)), np.empty((len(places_m), 6))
    weighted_m = (places_m * weights[..., None]).transpose(0, 2, 1)
    products, moments = weighted_m @ places_m, weighted_m @ offsets_m
    lhs[:, :3, :3] = np.trace(products, axis1=1, axis2=2)[:, None, None] * np.eye(3) - products
    lhs[:, 3:, 3:] = weights.sum(axis=1)[:, None, None] * np.eye(3)
    sums_m = weighted_m.sum(axis=2)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        lhs[:, i, 3 + j] = lhs[:, 3 + j, i] = -sums_m[:, k]
        lhs[:, j, 3 + i] = lhs[:, 3 + i, j] = sums_m[:, k]
        rhs[:, k] = moments[:, i, j] - moments[:, j, i]
    rhs[:, 3:] = np.einsum("spi,sp->si", offsets_m, weights)
    return lhs, rhs
