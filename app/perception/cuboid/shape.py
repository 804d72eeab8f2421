"""Upright boxes and cylinders: how far points lie from their surface, rays from their outline; where their corners are.

A candidate is a row ``x, y, z, yaw, sx, sy, sz``: center in meters and yaw in radians in the world frame, full lengths
in meters. B candidates, N points, M rays; leading dimensions (...) have points or rays, and candidates, of their own.
"""

from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from app.perception.cuboid.model import Shape
from roboprompt_client.types.arrays import Array

Reals = npt.NDArray[np.floating[Any]]
X, Y, Z, YAW, SX, SY, SZ = range(7)
ROUND_DIRECTIONS = 12  # the outline of a cylinder as tangents this many to the half turn: 0.2 mm of a radius of 26 mm
_TANGENTS_RAD = np.arange(ROUND_DIRECTIONS) * np.pi / ROUND_DIRECTIONS
TINY = 1e-12  # of a ray along an edge


def surface_distances_m(shape: Shape, candidates: Reals, points_m: Reals) -> Reals:
    """(..., B, N) signed distances of points (..., N, 3) from surfaces of candidates (..., B, 7); negative inside."""
    x, y, z = _places(candidates, points_m)
    half_x, half_y, half_z = _half_sizes(candidates)
    beyond = [np.hypot(x, y) - half_x] if shape == "cylinder" else [np.abs(x) - half_x, np.abs(y) - half_y]
    beyond.append(np.abs(z) - half_z)
    outside = np.sqrt(sum(np.maximum(item, 0) ** 2 for item in beyond))
    distances: Reals = outside + np.minimum(reduce(np.maximum, beyond), 0)
    return distances


def ray_distances_m(shape: Shape, candidates: Reals, eyes_m: Reals, rays: Reals) -> Reals:
    """(..., B, M) signed distances of rays (..., M, 3) from eyes (..., 3) to the outlines seen; negative: they hit.

    The greatest gap along any direction across the ray (separating axes); for a box the edges give those that matter.
    """
    along = _along_axes(candidates, *(rays[..., None, :, axis] for axis in (X, Y, Z)))
    eye, half = _places(candidates, eyes_m[..., None, :]), _half_sizes(candidates)
    if shape == "cylinder":
        return _round_distances_m(along, eye, half[0], half[2])
    far = [np.abs(item) for item in along]
    gaps = [
        (np.abs(along[j] * eye[i] - along[i] * eye[j]) - half[i] * far[j] - half[j] * far[i])
        / np.sqrt(np.maximum(1 - along[k] ** 2, TINY))
        for i, j, k in ((1, 2, 0), (2, 0, 1), (0, 1, 2))
    ]
    distances: Reals = reduce(np.maximum, gaps)
    return distances


def outline_points_m(shape: Shape, candidate: Array) -> Array:
    """(K, 3) world points whose convex hull is the shape."""
    half = candidate[SX:] / 2
    if shape == "cylinder":
        angles = np.linspace(0, 2 * np.pi, 2 * ROUND_DIRECTIONS, endpoint=False)
        across = np.stack([np.cos(angles), np.sin(angles)], axis=1) * half[0]
    else:
        across = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * half[:2]
    cos, sin = np.cos(candidate[YAW]), np.sin(candidate[YAW])
    turned = across @ np.array([[cos, sin], [-sin, cos]])
    rims = [np.column_stack([turned, np.full(len(turned), side * half[2])]) for side in (-1, 1)]
    points: Array = np.concatenate(rims) + candidate[:3]
    return points


def _half_sizes(candidates: Reals) -> list[Reals]:
    """(..., B, 1) along each axis."""
    return [candidates[..., side, None] / 2 for side in (SX, SY, SZ)]


def _places(candidates: Reals, points_m: Reals) -> tuple[Reals, Reals, Reals]:
    """(..., B, N) x, y and z of points (..., N, 3) in the candidates' frames."""
    return _along_axes(candidates, *(points_m[..., None, :, axis] - candidates[..., axis, None] for axis in (X, Y, Z)))


def _along_axes(candidates: Reals, x: Reals, y: Reals, z: Reals) -> tuple[Reals, Reals, Reals]:
    """World vectors along the candidates' axes."""
    cos, sin = np.cos(candidates[..., YAW, None]), np.sin(candidates[..., YAW, None])
    return cos * x + sin * y, cos * y - sin * x, z


def _round_distances_m(
    along: tuple[Reals, ...], eye: tuple[Reals, ...], radius_m: Reals, half_height_m: Reals
) -> Reals:
    (dx, dy, dz), (ox, oy, oz) = along, eye
    level = np.hypot(dx, dy)
    # across the ray: `side` lies level, `up` stands on ray and side
    sx, sy = -dy / level, dx / level
    ux, uy, uz = -sy * dz, sx * dz, sy * dx - sx * dy
    side_gap, up_gap = sx * ox + sy * oy, ux * ox + uy * oy + uz * oz
    tangents = _TANGENTS_RAD.astype(level.dtype).reshape(-1, *[1] * level.ndim)
    cos, sin = np.cos(tangents), np.sin(tangents)
    reach = radius_m * np.hypot(cos * sx + sin * ux, cos * sy + sin * uy) + half_height_m * np.abs(sin * uz)
    distances: Reals = (np.abs(cos * side_gap + sin * up_gap) - reach).max(axis=0)
    return distances
