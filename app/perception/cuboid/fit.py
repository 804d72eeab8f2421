"""The upright box or cylinder that agrees best with an object's depth and outline in one camera.

Depth says where its faces are, the outline in the color image where its edges are; the outline has no depth noise and
settles the yaw. Iteratively reweighted least squares (Levenberg-Marquardt) from several yaws at once, with distances to
many candidates at once.

A candidate is a row ``x, y, z, yaw, sx, sy, sz``: center in metres and yaw in radians in the world frame, full lengths
in metres. B candidates, N points, M rays.
"""

from dataclasses import dataclass

import numpy as np

from app.perception.cuboid.model import Shape
from app.perception.cuboid.view import View
from roboprompt_client.arrays import Array

X, Y, Z, YAW, SX, SY, SZ = range(7)
ROUND_DIRECTIONS = 12  # the outline of a cylinder as tangents this many to the half turn: 0.2 mm of a radius of 26 mm
_TANGENTS_RAD = np.arange(ROUND_DIRECTIONS) * np.pi / ROUND_DIRECTIONS
_TANGENT_COS, _TANGENT_SIN = np.cos(_TANGENTS_RAD), np.sin(_TANGENTS_RAD)
OUTLINE_SIGMA_PX = 0.6  # an edge between two pixels, from rounding to whole pixels and from blur
GROUND_SIGMA_M = 0.001
GROUND_CONTACT_M = 0.008  # what is found this near to the ground stands on it
ROBUST_SIGMAS = 2.5  # of Cauchy's weights: what lies much further off hardly counts
NUM_YAWS = 6
COARSE_STEPS, FINE_STEPS, FINALISTS = 2, 7, 2
COARSE_THINNING = 3
STEP = np.array([1e-4, 1e-4, 1e-4, 1e-3, 1e-4, 1e-4, 1e-4])  # of numerical derivatives, m and rad
MAX_STEP = np.array([0.02, 0.02, 0.02, 0.4, 0.01, 0.01, 0.01])
MIN_SIZE_M, MIN_HEIGHT_M = 5e-4, 1e-3
SETTLED = 2e-3  # a relative change in cost that is not worth another step
_PLACE: dict[Shape, tuple[int, ...]] = {"box": (X, Y, Z, YAW), "cylinder": (X, Y, Z)}
_SIZE: dict[Shape, tuple[int, ...]] = {"box": (SX, SY, SZ), "cylinder": (SX, SZ)}


def surface_distances_m(shape: Shape, candidates: Array, points_m: Array) -> Array:
    """(B, N) signed distances of points (N, 3) from the surface: negative inside."""
    half = candidates.T[SX:, :, None] / 2
    axes, middles_m = _frames(candidates)
    places = axes @ points_m.T - middles_m
    if shape == "cylinder":
        beyond = np.stack([np.hypot(places[0], places[1]) - half[0], np.abs(places[2]) - half[2]])
    else:
        beyond = np.abs(places) - half
    outside = np.sqrt((np.maximum(beyond, 0) ** 2).sum(axis=0))
    distances: Array = outside + np.minimum(beyond.max(axis=0), 0)
    return distances


def ray_distances_m(shape: Shape, candidates: Array, eye_m: Array, rays: Array) -> Array:
    """(B, M) signed distances of rays (M, 3) from the eye (3,) to the outline that it sees: negative where they hit.

    The greatest gap along any direction across the ray (separating axes); for a box the edges give those that matter.
    """
    half = candidates.T[SX:, :, None] / 2
    axes, middles_m = _frames(candidates)
    along, eye = axes @ rays.T, axes @ eye_m[:, None] - middles_m
    if shape == "cylinder":
        return _round_distances_m(along, eye, half[0], half[2])
    (d1, e1, h1), (d2, e2, h2) = ((along[order], eye[order], half[order]) for order in ([1, 2, 0], [2, 0, 1]))
    gaps = np.abs(d2 * e1 - d1 * e2) - h1 * np.abs(d2) - h2 * np.abs(d1)
    distances: Array = (gaps / np.sqrt(d1**2 + d2**2)).max(axis=0)
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


def _frames(candidates: Array) -> tuple[Array, Array]:
    """(3, B, 3) unit vectors along x, y and z of each candidate, and (3, B, 1) its middle along them."""
    axes = np.zeros((3, len(candidates), 3))
    axes[0, :, 0] = axes[1, :, 1] = np.cos(candidates[:, YAW])
    axes[0, :, 1] = np.sin(candidates[:, YAW])
    axes[1, :, 0] = -axes[0, :, 1]
    axes[2, :, 2] = 1
    return axes, (axes * candidates[:, :3]).sum(axis=2, keepdims=True)


def _round_distances_m(along: Array, eye: Array, radius_m: Array, half_height_m: Array) -> Array:
    (dx, dy, dz), (ox, oy, oz) = along, eye
    level = np.hypot(dx, dy)
    # across the ray: `side` lies level, `up` stands on ray and side
    sx, sy = -dy / level, dx / level
    ux, uy, uz = -sy * dz, sx * dz, sy * dx - sx * dy
    side_gap, up_gap = sx * ox + sy * oy, ux * ox + uy * oy + uz * oz
    cos, sin = _TANGENT_COS[:, None, None], _TANGENT_SIN[:, None, None]
    reach = radius_m * np.hypot(cos * sx + sin * ux, cos * sy + sin * uy) + half_height_m * np.abs(sin * uz)
    distances: Array = (np.abs(cos * side_gap + sin * up_gap) - reach).max(axis=0)
    return distances


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted shape.

    Attributes:
        candidate: (7,) as in `app.perception.cuboid.fit`.
        cost: of its residuals; half the sum of their squares in units of sigma, outliers bounded.
        rival_yaw_rad, rival_cost: of the best of the other yaws that were tried to the end; cost inf if there is none.
    """

    candidate: Array
    cost: float
    rival_yaw_rad: float
    rival_cost: float


def fit_upright(view: View, shape: Shape, size_m: Array, *, yaw_range_rad: float, free_size: bool = False) -> Fit:
    """The best candidate of a size, or of any size near it.

    Args:
        size_m: (3,) full lengths; where to begin if the size is free.
        yaw_range_rad: the turn that leaves the shape unchanged: yaws are tried within it. Ignored for a cylinder.
    """
    columns = [*_PLACE[shape], *(_SIZE[shape] if free_size else ())]
    starts = _starts(view, shape, size_m, yaw_range_rad)
    if len(starts) > FINALISTS:
        starts, costs = _descend(view.thinned(COARSE_THINNING), shape, starts, columns, COARSE_STEPS)
        starts = _distinct(starts[np.argsort(costs)], yaw_range_rad)[:FINALISTS]
    ends, costs = _descend(view, shape, starts, columns, FINE_STEPS)
    if shape == "cylinder":
        ends[:, SY] = ends[:, SX]
    order = np.argsort(costs)
    ends, costs = ends[order], costs[order]
    rivals = [
        k for k in range(1, len(ends)) if abs(_wrapped(ends[k, YAW] - ends[0, YAW], yaw_range_rad)) > np.radians(5)
    ]
    rival_yaw, rival_cost = (ends[rivals[0], YAW], costs[rivals[0]]) if rivals else (0.0, np.inf)
    return Fit(ends[0], float(costs[0]), float(rival_yaw), float(rival_cost))


def fit_any_size(view: View, shape: Shape) -> Fit:
    """The best candidate of whatever size; a box's sides may have changed places with each other."""
    low, high = np.percentile(view.points_m, [2, 98], axis=0)
    side_m = float(np.hypot(*(high - low)[:2])) / np.sqrt(2)
    begin_m = np.array([side_m, side_m, max(high[2] - low[2], MIN_HEIGHT_M)])
    return fit_upright(view, shape, begin_m, yaw_range_rad=np.pi / 2, free_size=True)


def _starts(view: View, shape: Shape, size_m: Array, yaw_range_rad: float) -> Array:
    """Candidates (B, 7) behind the middle of what is seen."""
    away = view.points_m.mean(axis=0) - view.eye_m
    away[2] = 0
    center = view.points_m.mean(axis=0) + away / np.linalg.norm(away) * size_m[:2].mean() / 4
    center[2] = np.percentile(view.points_m[:, 2], 95) - size_m[2] / 2
    yaws = [0.0] if shape == "cylinder" else np.arange(NUM_YAWS) / NUM_YAWS * yaw_range_rad
    return np.array([[*center, yaw, *size_m] for yaw in yaws])


def _distinct(candidates: Array, yaw_range_rad: float) -> Array:
    """Without those that turned out like an earlier one."""
    kept: list[Array] = []
    for item in candidates:
        if all(abs(_wrapped(item[YAW] - other[YAW], yaw_range_rad)) > np.radians(5) for other in kept):
            kept.append(item)
    return np.array(kept)


def _wrapped(angle_rad: float, period_rad: float) -> float:
    return (angle_rad + period_rad / 2) % period_rad - period_rad / 2


def _descend(view: View, shape: Shape, starts: Array, columns: list[int], steps: int) -> tuple[Array, Array]:
    """Improve all candidates (B, 7) in `columns`; their costs (B,)."""
    best, best_costs = starts.copy(), np.full(len(starts), np.inf)
    damping = np.full(len(starts), 1e-3)
    trial = starts
    for step in range(steps + 1):
        residuals, jacobian = _linearised(view, shape, trial, columns if step < steps else [])
        costs = np.log1p((residuals / ROBUST_SIGMAS) ** 2).sum(axis=1) * ROBUST_SIGMAS**2 / 2
        better = costs < best_costs
        settled = step > 1 and bool((np.abs(best_costs - costs) < SETTLED * best_costs).all())
        best[better], best_costs[better] = trial[better], costs[better]
        if settled or step == steps:
            break
        damping = np.where(better, damping / 4, damping * 8)
        if step == 0:
            kept_residuals, kept_jacobian = residuals, jacobian
        kept_residuals[better], kept_jacobian[better] = residuals[better], jacobian[better]
        trial = _stepped(best, kept_residuals, kept_jacobian, damping, columns)
    return best, best_costs


def _stepped(best: Array, residuals: Array, jacobian: Array, damping: Array, columns: list[int]) -> Array:
    weights = 1 / (1 + (residuals / ROBUST_SIGMAS) ** 2)
    weighted = jacobian * weights[:, None]  # (B, P, R)
    normal = weighted @ jacobian.transpose(0, 2, 1)
    gradient = weighted @ residuals[..., None]
    diagonal = np.einsum("bpp->bp", normal)
    lifted = normal + np.eye(len(columns)) * (damping[:, None] * diagonal + 1e-9)[:, None]
    move = np.linalg.solve(lifted, gradient)[..., 0]
    trial = best.copy()
    trial[:, columns] -= np.clip(move, -MAX_STEP[columns], MAX_STEP[columns])
    trial[:, SX:] = np.maximum(trial[:, SX:], MIN_SIZE_M)
    return trial


def _linearised(view: View, shape: Shape, candidates: Array, columns: list[int]) -> tuple[Array, Array]:
    """Residuals (B, R) in sigmas and their derivatives (B, P, R)."""
    shifts = np.zeros((len(columns) + 1, candidates.shape[1]))
    shifts[np.arange(1, len(columns) + 1), columns] = STEP[columns]
    shifted = (candidates[:, None] + shifts).reshape(-1, candidates.shape[1])
    values = _residuals(view, shape, shifted).reshape(len(candidates), len(columns) + 1, -1)
    return values[:, 0].copy(), (values[:, 1:] - values[:, :1]) / STEP[columns][:, None]


def _residuals(view: View, shape: Shape, candidates: Array) -> Array:
    parts = [surface_distances_m(shape, candidates, view.points_m) / view.point_sigma_m]
    if len(view.rays):
        sigma_m = OUTLINE_SIGMA_PX * view.footprint_m
        parts.append(ray_distances_m(shape, candidates, view.eye_m, view.rays) / sigma_m)
    if view.ground_m is not None:
        gap = candidates[:, Z] - candidates[:, SZ] / 2 - view.ground_m
        near = np.abs(gap) < GROUND_CONTACT_M
        parts.append(np.where(near, gap, GROUND_CONTACT_M)[:, None] / GROUND_SIGMA_M)
    return np.concatenate(parts, axis=1)
