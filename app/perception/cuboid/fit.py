"""The upright box or cylinder that agrees best with an object's depth and outline in one camera.

Depth says where its faces are, the outline in the color image where its edges are; the outline has no depth noise and
settles the yaw. Iteratively reweighted least squares (Levenberg-Marquardt) from several yaws, for all things of an
image at once: of single ones most of the time would go into calls.

V views of a thing each, B candidates for each (`app.perception.cuboid.shape`), N points, M rays.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from app.perception.cuboid.model import Shape
from app.perception.cuboid.pieces import quantiles
from app.perception.cuboid.shape import SX, SY, SZ, YAW, Reals, X, Y, Z, ray_distances_m, surface_distances_m
from app.perception.cuboid.view import View
from roboprompt_client.types.arrays import Array

FAST = np.float32  # of distances while candidates are improved: 0.1 um of a meter
OUTLINE_SIGMA_PX = 0.6  # an edge between two pixels, from rounding to whole pixels and from blur
GROUND_SIGMA_M = 0.001
GROUND_CONTACT_M = 0.008  # what is found this near to the ground stands on it
ROBUST_SIGMAS = 2.5  # of Cauchy's weights: what lies much further off hardly counts
BETWEEN_YAWS_RAD = np.radians(30)  # of the starts
COARSE_STEPS, FINE_STEPS, FINALISTS = 2, 7, 2
COARSE_THINNING = 3
STEP = np.array([1e-4, 1e-4, 1e-4, 1e-3, 1e-4, 1e-4, 1e-4])  # of numerical derivatives, m and rad
MAX_STEP = np.array([0.02, 0.02, 0.02, 0.4, 0.01, 0.01, 0.01])
MIN_SIZE_M, MIN_HEIGHT_M = 5e-4, 1e-3
SAME_YAW_RAD = np.radians(5)  # yaws that differ by less are one
SETTLED = 2e-3  # a relative change in cost that is not worth another step
CATCHES_UP = 0.1  # of how far its cost lies behind its view's best: a candidate that gains less will not catch up
_PLACE: dict[Shape, tuple[int, ...]] = {"box": (X, Y, Z, YAW), "cylinder": (X, Y, Z)}
_SIZE: dict[Shape, tuple[int, ...]] = {"box": (SX, SY, SZ), "cylinder": (SX, SZ)}


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted shape.

    Attributes:
        candidate: (7,) as in `app.perception.cuboid.shape`.
        cost: of its residuals; half the sum of their squares in units of sigma, outliers bounded.
        rival_yaw_rad, rival_cost: of the best of the other yaws that were tried to the end; cost inf if there is none.
    """

    candidate: Array
    cost: float
    rival_yaw_rad: float
    rival_cost: float


@dataclass(frozen=True, eq=False)
class _Measured:
    """What V views show, each from its eye: `FAST` numbers have no digits left for a world far away.

    Views with fewer points or rays than others are filled up with some of infinite sigma.

    Attributes:
        eyes: (V, 1, 7) what is subtracted from candidates.
        points_m, rays: (V, N, 3) and (V, M, 3), see `View`.
        point_sigma_m, ray_sigma_m: (V, 1, N) and (V, 1, M).
        ground_m, ground_sigma_m: (V, 1); infinite sigma where there is no ground.
    """

    eyes: Array
    points_m: Reals
    point_sigma_m: Reals
    rays: Reals
    ray_sigma_m: Reals
    ground_m: Reals
    ground_sigma_m: Reals

    @classmethod
    def of(cls, views: Sequence[View], thinning: int = 1) -> Self:
        """With every so many of the points and rays."""
        eyes = np.array([[[*view.eye_m, 0, 0, 0, 0]] for view in views])
        points_m = [view.points_m[::thinning] - view.eye_m for view in views]
        rays = [view.rays[::thinning] for view in views]
        ground_m = [[0.0 if view.ground_m is None else view.ground_m - view.eye_m[2]] for view in views]
        ground_sigma_m = [[np.inf if view.ground_m is None else GROUND_SIGMA_M] for view in views]
        return cls(
            eyes,
            *_filled_up(points_m, [view.point_sigma_m for view in views]),
            *_filled_up(rays, [OUTLINE_SIGMA_PX * view.footprint_m for view in views]),
            np.array(ground_m, FAST),
            np.array(ground_sigma_m, FAST),
        )


def _filled_up(vectors: Sequence[Array], sigmas: Sequence[float]) -> tuple[Reals, Reals]:
    """(V, most, 3) of vectors (N, 3) each, and (V, 1, most) their sigmas."""
    most = max(map(len, vectors))
    filled, filled_sigmas = np.ones((len(vectors), most, 3), FAST), np.full((len(vectors), 1, most), np.inf, FAST)
    for number, (those, sigma) in enumerate(zip(vectors, sigmas, strict=True)):
        filled[number, : len(those)], filled_sigmas[number, 0, : len(those)] = those, sigma
    return filled, filled_sigmas


def fit_upright(views: Sequence[View], shape: Shape, size_m: Array, *, yaw_range_rad: float) -> list[Fit]:
    """For each view the best candidate of a size.

    Args:
        size_m: (3,) full lengths.
        yaw_range_rad: the turn that leaves the shape unchanged: yaws are tried within it. Ignored for a cylinder.
    """
    return _fits(views, shape, size_m, yaw_range_rad, _PLACE[shape]) if views else []


def fit_any_size(view: View, shape: Shape) -> Fit:
    """The best candidate of whatever size; a box's sides may have changed places with each other."""
    low, high = quantiles(view.points_m, 0.02, 0.98)
    side_m = float(np.hypot(*(high - low)[:2])) / np.sqrt(2)
    begin_m = np.array([side_m, side_m, max(high[2] - low[2], MIN_HEIGHT_M)])
    return _fits([view], shape, begin_m, np.pi / 2, [*_PLACE[shape], *_SIZE[shape]])[0]


def _fits(
    views: Sequence[View], shape: Shape, size_m: Array, yaw_range_rad: float, columns: Sequence[int]
) -> list[Fit]:
    """The best candidates when `columns` of the starts may change."""
    starts = np.array([_starts(view, shape, size_m, yaw_range_rad) for view in views])
    if starts.shape[1] > FINALISTS:
        coarse = _Measured.of(views, COARSE_THINNING)
        starts, costs = _descend(coarse, shape, starts, columns, COARSE_STEPS)
        ordered = np.take_along_axis(starts, np.argsort(costs)[..., None], axis=1)
        starts = np.array([_distinct(ends, yaw_range_rad) for ends in ordered])
    ends, costs = _descend(_Measured.of(views), shape, starts, columns, FINE_STEPS)
    if shape == "cylinder":
        ends[..., SY] = ends[..., SX]
    return [_best(*those, yaw_range_rad) for those in zip(ends, costs, strict=True)]


def _best(ends: Array, costs: Array, yaw_range_rad: float) -> Fit:
    """Of candidates (B, 7) with their costs (B,)."""
    best, *others = np.argsort(costs)
    turned_rad = _wrapped(ends[:, YAW] - ends[best, YAW], yaw_range_rad)
    rival = next((k for k in others if abs(turned_rad[k]) > SAME_YAW_RAD), None)
    rival_yaw, rival_cost = (0.0, np.inf) if rival is None else (ends[rival, YAW], costs[rival])
    return Fit(ends[best], float(costs[best]), float(rival_yaw), float(rival_cost))


def _starts(view: View, shape: Shape, size_m: Array, yaw_range_rad: float) -> Array:
    """Candidates (B, 7) behind the middle of what is seen."""
    middle_m = view.points_m.mean(axis=0)
    away = middle_m - view.eye_m
    away[2] = 0
    center = middle_m + away / np.linalg.norm(away) * size_m[:2].mean() / 4
    (top_m,) = quantiles(view.points_m[:, 2], 0.95)
    center[2] = top_m - size_m[2] / 2
    yaws = [0.0] if shape == "cylinder" else np.arange(0, yaw_range_rad - SAME_YAW_RAD, BETWEEN_YAWS_RAD)
    return np.array([[*center, yaw, *size_m] for yaw in yaws])


def _distinct(candidates: Array, yaw_range_rad: float) -> Array:
    """(FINALISTS, 7) the first candidates without those that turned out like an earlier one; the first again if few."""
    kept: list[Array] = []
    for item in candidates:
        if all(abs(_wrapped(item[YAW] - other[YAW], yaw_range_rad)) > SAME_YAW_RAD for other in kept):
            kept.append(item)
    return np.array((kept + kept[:1] * FINALISTS)[:FINALISTS])


def _wrapped(angle_rad: Array, period_rad: float) -> Array:
    return (angle_rad + period_rad / 2) % period_rad - period_rad / 2


def _descend(
    measured: _Measured, shape: Shape, starts: Array, columns: Sequence[int], steps: int
) -> tuple[Array, Array]:
    """Improve all candidates (V, B, 7) in `columns`; their costs (V, B)."""
    columns = list(columns)
    shifts = np.concatenate([np.zeros((1, 7)), np.diag(STEP)[columns]])  # of numerical derivatives
    best, best_costs = starts.copy(), np.full(starts.shape[:2], np.inf)
    damping = np.full(starts.shape[:2], 1e-3)
    trial = starts
    for step in range(steps + 1):
        shifted = trial[:, :, None] + (shifts if step < steps else shifts[:1])
        values = _residuals(measured, shape, shifted.reshape(len(starts), -1, 7)).reshape(*shifted.shape[:3], -1)
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
    """The candidates after a step by their residuals (V, B, R) in sigmas and the derivatives (V, B, P, R) of these."""
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


def _residuals(measured: _Measured, shape: Shape, candidates: Reals) -> Reals:
    """(V, B, N + M + 1) in sigmas: of points, rays and the ground."""
    candidates = (candidates - measured.eyes).astype(FAST)
    gap_m = candidates[..., Z] - candidates[..., SZ] / 2 - measured.ground_m
    gap_m = np.where(np.abs(gap_m) < GROUND_CONTACT_M, gap_m, GROUND_CONTACT_M)
    parts = [
        surface_distances_m(shape, candidates, measured.points_m) / measured.point_sigma_m,
        ray_distances_m(shape, candidates, np.zeros(3, FAST), measured.rays) / measured.ray_sigma_m,
        (gap_m / measured.ground_sigma_m)[..., None],
    ]
    return np.concatenate(parts, axis=-1)
