"""Distances to an upright box or cylinder, for many candidate poses at once.

A candidate is a row ``x, y, z, yaw, sx, sy, sz``: centre in metres and yaw in radians in the world frame, full lengths
in metres. B candidates, N points, M rays.
"""

from typing import Literal

import numpy as np

from app.pipeline.arrays import Array

Shape = Literal["box", "cylinder"]
SHAPES: tuple[Shape, ...] = ("box", "cylinder")
X, Y, Z, YAW, SX, SY, SZ = range(7)
NUM_PARAMETERS = 7
ROUND_DIRECTIONS = 12  # the outline of a cylinder as tangents this many to the half turn: 0.2 mm of a radius of 26 mm
_TANGENTS_RAD = np.arange(ROUND_DIRECTIONS) * np.pi / ROUND_DIRECTIONS
_TANGENT_COS, _TANGENT_SIN = np.cos(_TANGENTS_RAD), np.sin(_TANGENTS_RAD)


def surface_distances_m(shape: Shape, candidates: Array, points_m: Array) -> Array:
    """(B, N) signed distances of points (N, 3) from the surface: negative inside."""
    x, y, z = _local(candidates, points_m[None] - candidates[:, None, :3])
    half = candidates[:, None, SX:] / 2
    if shape == "cylinder":
        across, outside_z = np.hypot(x, y) - half[..., 0], np.abs(z) - half[..., 2]
        outside = np.hypot(np.maximum(across, 0), np.maximum(outside_z, 0))
        return outside + np.minimum(np.maximum(across, outside_z), 0)
    qx, qy, qz = np.abs(x) - half[..., 0], np.abs(y) - half[..., 1], np.abs(z) - half[..., 2]
    outside = np.sqrt(np.maximum(qx, 0) ** 2 + np.maximum(qy, 0) ** 2 + np.maximum(qz, 0) ** 2)
    distances: Array = outside + np.minimum(np.maximum(np.maximum(qx, qy), qz), 0)
    return distances


def ray_distances_m(shape: Shape, candidates: Array, eye_m: Array, rays: Array) -> Array:
    """(B, M) signed distances of rays (M, 3) from the eye (3,) to the outline that it sees: negative where they hit.

    The greatest gap along any direction across the ray (separating axes); for a box the edges give those that matter.
    """
    dx, dy, dz = _local(candidates, np.broadcast_to(rays[None], (len(candidates), *rays.shape)))
    ox, oy, oz = _local(candidates, (eye_m - candidates[:, :3])[:, None])
    hx, hy, hz = (candidates[:, None, k] / 2 for k in (SX, SY, SZ))
    if shape == "cylinder":
        return _round_distances_m((dx, dy, dz), (ox, oy, oz), hx, hz)
    adx, ady, adz = np.abs(dx), np.abs(dy), np.abs(dz)
    along_x = (np.abs(dz * oy - dy * oz) - hy * adz - hz * ady) / np.hypot(dy, dz)
    along_y = (np.abs(dz * ox - dx * oz) - hx * adz - hz * adx) / np.hypot(dx, dz)
    along_z = (np.abs(dy * ox - dx * oy) - hx * ady - hy * adx) / np.hypot(dx, dy)
    distances: Array = np.maximum(np.maximum(along_x, along_y), along_z)
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


def _local(candidates: Array, vectors: Array) -> tuple[Array, Array, Array]:
    """World vectors (B, N, 3) along each candidate's axes: three times (B, N)."""
    cos, sin = np.cos(candidates[:, YAW, None]), np.sin(candidates[:, YAW, None])
    x, y = vectors[..., 0], vectors[..., 1]
    return x * cos + y * sin, y * cos - x * sin, vectors[..., 2]


def _round_distances_m(
    direction: tuple[Array, Array, Array], eye: tuple[Array, Array, Array], radius_m: Array, half_height_m: Array
) -> Array:
    (dx, dy, dz), (ox, oy, oz) = direction, eye
    level = np.hypot(dx, dy)
    # across the ray: `side` lies level, `up` stands on ray and side
    sx, sy = -dy / level, dx / level
    ux, uy, uz = -sy * dz, sx * dz, sy * dx - sx * dy
    side_gap, up_gap = sx * ox + sy * oy, ux * ox + uy * oy + uz * oz
    cos, sin = _TANGENT_COS[:, None, None], _TANGENT_SIN[:, None, None]
    reach = radius_m * np.hypot(cos * sx + sin * ux, cos * sy + sin * uy) + half_height_m * np.abs(sin * uz)
    distances: Array = (np.abs(cos * side_gap + sin * up_gap) - reach).max(axis=0)
    return distances
