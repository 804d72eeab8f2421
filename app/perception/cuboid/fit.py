"""The upright box or cylinder that agrees best with an object's depth and outline in one camera.

Depth says where its faces are, the outline in the color image where its edges are; the outline has no depth noise and
determines the yaw. Iteratively reweighted least squares (Levenberg-Marquardt) from several yaws, for all objects of
an image in one batch, since calls would dominate the time otherwise.

Shapes: V pieces of one object each, B candidates per piece (`app.perception.cuboid.shape`), N points, M rays.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from app.perception.cuboid.measurements import Measurements
from app.perception.cuboid.model import Shape
from app.perception.cuboid.segmentation import quantiles
from app.perception.cuboid.shape import SX, SY, SZ, YAW, Reals, X, Y, Z, ray_distances_m, surface_distances_m
from roboprompt_client.types.arrays import Array

FAST = np.float32  # the type of residuals during optimization: 0.1 um at 1 m
OUTLINE_SIGMA_PX = 0.6  # an edge between two pixels, from rounding to whole pixels and from blur
GROUND_SIGMA_M = 0.001
GROUND_CONTACT_M = 0.008  # a candidate whose bottom is closer to the ground stands on it
ROBUST_SIGMAS = 2.5  # scale of the Cauchy loss: larger residuals have little weight
BETWEEN_YAWS_RAD = np.radians(30)  # between the starting yaws
COARSE_STEPS, FINE_STEPS, FINALISTS = 2, 7, 2
COARSE_THINNING = 3
STEP = np.array([1e-4, 1e-4, 1e-4, 1e-3, 1e-4, 1e-4, 1e-4])  # of numerical derivatives, m and rad
MAX_STEP = np.array([0.02, 0.02, 0.02, 0.4, 0.01, 0.01, 0.01])
MIN_SIZE_M, MIN_HEIGHT_M = 5e-4, 1e-3
SAME_YAW_RAD = np.radians(5)  # closer yaws count as equal
SETTLED = 2e-3  # relative change in cost below which the optimization stops
# A candidate whose cost falls by less than this share of its distance to the best cost of its piece cannot win.
CATCHES_UP = 0.1
_PLACE: dict[Shape, tuple[int, ...]] = {"box": (X, Y, Z, YAW), "cylinder": (X, Y, Z)}
_SIZE: dict[Shape, tuple[int, ...]] = {"box": (SX, SY, SZ), "cylinder": (SX, SZ)}


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted shape.

    Attributes:
        candidate: (7,) as in `app.perception.cuboid.shape`.
        cost: half the sum of squared residuals in units of sigma, robust to outliers.
        rival_yaw_rad, rival_cost: of the best other yaw that was optimized; infinite cost if there is none.
    """

    candidate: Array
    cost: float
    rival_yaw_rad: float
    rival_cost: float


@dataclass(frozen=True, eq=False)
class _FitBatch:
    """Measurements of V pieces, relative to each camera's position to keep `FAST` numbers precise.

    Views with fewer points or rays than others are padded with measurements of infinite sigma.

    Attributes:
        eyes: (V, 1, 7) the camera positions, to subtract from candidates.
        points_m, rays: (V, N, 3) and (V, M, 3), see `Measurements`.
        point_sigma_m, ray_sigma_m: (V, 1, N) and (V, 1, M).
        ground_m, ground_sigma_m: (V, 1); infinite sigma where no ground is visible.
    """

    eyes: Array
    points_m: Reals
    point_sigma_m: Reals
    rays: Reals
    ray_sigma_m: Reals
    ground_m: Reals
    ground_sigma_m: Reals

    @classmethod
    def of(cls, pieces: Sequence[Measurements], thinning: int = 1) -> Self:
        """Return the measurements of pieces, with every `thinning`-th point and ray."""
        eyes = np.array([[[*piece.eye_m, 0, 0, 0, 0]] for piece in pieces])
        points_m = [piece.points_m[::thinning] - piece.eye_m for piece in pieces]
        rays = [piece.rays[::thinning] for piece in pieces]
        ground_m = [[0.0 if piece.ground_m is None else piece.ground_m - piece.eye_m[2]] for piece in pieces]
        ground_sigma_m = [[np.inf if piece.ground_m is None else GROUND_SIGMA_M] for piece in pieces]
        return cls(
            eyes,
            *_filled_up(points_m, [piece.point_sigma_m for piece in pieces]),
            *_filled_up(rays, [OUTLINE_SIGMA_PX * piece.footprint_m for piece in pieces]),
            np.array(ground_m, FAST),
            np.array(ground_sigma_m, FAST),
        )


def _filled_up(vectors: Sequence[Array], sigmas: Sequence[float]) -> tuple[Reals, Reals]:
    """Return vectors of V pieces, (N, 3) each, padded to (V, most, 3), and their sigmas (V, 1, most)."""
    most = max(map(len, vectors))
    filled, filled_sigmas = np.ones((len(vectors), most, 3), FAST), np.full((len(vectors), 1, most), np.inf, FAST)
    for number, (those, sigma) in enumerate(zip(vectors, sigmas, strict=True)):
        filled[number, : len(those)], filled_sigmas[number, 0, : len(those)] = those, sigma
    return filled, filled_sigmas


def fit_upright(pieces: Sequence[Measurements], shape: Shape, size_m: Array, *, yaw_range_rad: float) -> list[Fit]:
    """Return the best candidate of a known size for each piece.

    Args:
        size_m: (3,) full lengths.
        yaw_range_rad: the rotation symmetry of the shape: starting yaws lie within it. Ignored for a cylinder.
    """
    return _fits(pieces, shape, size_m, yaw_range_rad, _PLACE[shape]) if pieces else []


def fit_any_size(piece: Measurements, shape: Shape) -> Fit:
    """Return the best candidate of unknown size; a box's x and y sides may be swapped."""
    low, high = quantiles(piece.points_m, 0.02, 0.98)
    side_m = float(np.hypot(*(high - low)[:2])) / np.sqrt(2)
    begin_m = np.array([side_m, side_m, max(high[2] - low[2], MIN_HEIGHT_M)])
    return _fits([piece], shape, begin_m, np.pi / 2, [*_PLACE[shape], *_SIZE[shape]])[0]


def _fits(
    pieces: Sequence[Measurements], shape: Shape, size_m: Array, yaw_range_rad: float, columns: Sequence[int]
) -> list[Fit]:
    """Return the best candidate for each piece; `columns` of the candidates are optimized."""
    starts = np.array([_starts(piece, shape, size_m, yaw_range_rad) for piece in pieces])
    if starts.shape[1] > FINALISTS:
        coarse = _FitBatch.of(pieces, COARSE_THINNING)
        starts, costs = _descend(coarse, shape, starts, columns, COARSE_STEPS)
        ordered = np.take_along_axis(starts, np.argsort(costs)[..., None], axis=1)
        starts = np.array([_distinct(ends, yaw_range_rad) for ends in ordered])
    ends, costs = _descend(_FitBatch.of(pieces), shape, starts, columns, FINE_STEPS)
    if shape == "cylinder":
        ends[..., SY] = ends[..., SX]
    return [_best(*those, yaw_range_rad) for those in zip(ends, costs, strict=True)]


def _best(ends: Array, costs: Array, yaw_range_rad: float) -> Fit:
    """Return the best of candidates (B, 7) with costs (B,)."""
    best, *others = np.argsort(costs)
    turned_rad = _wrapped(ends[:, YAW] - ends[best, YAW], yaw_range_rad)
    rival = next((k for k in others if abs(turned_rad[k]) > SAME_YAW_RAD), None)
    rival_yaw, rival_cost = (0.0, np.inf) if rival is None else (ends[rival, YAW], costs[rival])
    return Fit(ends[best], float(costs[best]), float(rival_yaw), float(rival_cost))


def _starts(piece: Measurements, shape: Shape, size_m: Array, yaw_range_rad: float) -> Array:
    """Return starting candidates (B, 7), their centers behind the visible points."""
    middle_m = piece.points_m.mean(axis=0)
    away = middle_m - piece.eye_m
    away[2] = 0
    center = middle_m + away / np.linalg.norm(away) * size_m[:2].mean() / 4
    (top_m,) = quantiles(piece.points_m[:, 2], 0.95)
    center[2] = top_m - size_m[2] / 2
    yaws = [0.0] if shape == "cylinder" else np.arange(0, yaw_range_rad - SAME_YAW_RAD, BETWEEN_YAWS_RAD)
    return np.array([[*center, yaw, *size_m] for yaw in yaws])


def _distinct(candidates: Array, yaw_range_rad: float) -> Array:
    """Return the first (FINALISTS, 7) candidates of distinct yaw; the first one repeated if there are fewer."""
    kept: list[Array] = []
    for item in candidates:
        if all(abs(_wrapped(item[YAW] - other[YAW], yaw_range_rad)) > SAME_YAW_RAD for other in kept):
            kept.append(item)
    return np.array((kept + kept[:1] * FINALISTS)[:FINALISTS])


def _wrapped(angle_rad: Array, period_rad: float) -> Array:
    return (angle_rad + period_rad / 2) % period_rad - period_rad / 2


def _descend(batch: _FitBatch, shape: Shape, starts: Array, columns: Sequence[int], steps: int) -> tuple[Array, Array]:
    """Return candidates (V, B, 7), optimized in `columns`, and their costs (V, B)."""
    columns = list(columns)
    shifts = np.concatenate([np.zeros((1, 7)), np.diag(STEP)[columns]])  # of numerical derivatives
    best, best_costs = starts.copy(), np.full(starts.shape[:2], np.inf)
    damping = np.full(starts.shape[:2], 1e-3)
    trial = starts
    for step in range(steps + 1):
        shifted = trial[:, :, None] + (shifts if step < steps else shifts[:1])
        values = _residuals(batch, shape, shifted.reshape(len(starts), -1, 7)).reshape(*shifted.shape[:3], -1)
        residuals = values[:, :, 0]
        costs = np.log1p((residuals / ROBUST_SIGMAS) ** 2).sum(axis=-1) * ROBUST_SIGMAS**2 / 2
        better = costs < best_costs
        behind = costs - costs.min(axis=1, keepdims=True)
        settled = step > 1 and bool((np.abs(best_costs - costs) < SETTLED * best_costs + CATCHES_UP * behind).all())
        best[better], best_costs[better] = trial[better], costs[better]
        if settled or step == steps:
            break
        damping = np.where(better, damping / 4, damping * 8)
        jacobian = (values[:, :, 1:] - values[:, :, :1]) / STEP.astype(FAST)[columns, None]
        if step == 0:
            kept_residuals, kept_jacobian = residuals, jacobian
        kept_residuals[better], kept_jacobian[better] = residuals[better], jacobian[better]
        trial = _stepped(best, kept_residuals, kept_jacobian, damping, columns)
    return best, best_costs


def _stepped(best: Array, residuals: Reals, jacobian: Reals, damping: Array, columns: list[int]) -> Array:
    """Return the candidates after one step, from residuals (V, B, R) in sigmas and their derivatives (V, B, P, R)."""
    weights = 1 / (1 + (residuals / ROBUST_SIGMAS) ** 2)
    weighted = jacobian * weights[..., None, :]
    normal = weighted @ jacobian.swapaxes(-1, -2)
    gradient = weighted @ residuals[..., None]
    diagonal = np.arange(len(columns))
    normal[..., diagonal, diagonal] += damping[..., None] * normal[..., diagonal, diagonal] + 1e-9
    move = np.linalg.solve(normal.astype(np.float64), gradient)[..., 0]
    trial = best.copy()
    trial[..., columns] -= np.clip(move, -MAX_STEP[columns], MAX_STEP[columns])
    trial[..., SX:] = np.maximum(trial[..., SX:], MIN_SIZE_M)
    return trial


def _residuals(batch: _FitBatch, shape: Shape, candidates: Reals) -> Reals:
    """Return residuals (V, B, N + M + 1) in sigmas: of points, rays and the ground."""
    candidates = (candidates - batch.eyes).astype(FAST)
    gap_m = candidates[..., Z] - candidates[..., SZ] / 2 - batch.ground_m
    gap_m = np.where(np.abs(gap_m) < GROUND_CONTACT_M, gap_m, GROUND_CONTACT_M)
    parts = [
        surface_distances_m(shape, candidates, batch.points_m) / batch.point_sigma_m,
        ray_distances_m(shape, candidates, np.zeros(3, FAST), batch.rays) / batch.ray_sigma_m,
        (gap_m / batch.ground_sigma_m)[..., None],
    ]
    return np.concatenate(parts, axis=-1)
