"""How far a pose from markers can be trusted, and why not further."""

import math
from collections.abc import Sequence

import numpy as np

from app.perception.marker_fit import MarkerFit
from app.perception.marker_view import MarkerView
from app.pipeline.camera import Camera

# From the first value, which takes nothing away, to the second, which takes everything. Chosen by what a 5 cm cube's
# grasp forgives; on renderings with a D400's noise a marker of 20 px has 0.04 px, 0.7 mm and 0.6 degrees.
CORNER_RMS_PX = (0.5, 3.0)
POSITION_SIGMA_M = (0.005, 0.02)
ROTATION_SIGMA_DEG = (3.0, 12.0)
RANGE_DISAGREEMENT = (0.05, 0.15)
RIVAL_SCALE = 4.0  # confidence tanh(d / 4) is 2 p - 1, p the better pose's probability when costs differ by d


def depth_contradiction(camera: Camera, view: MarkerView) -> str:
    """What is wrong if the marker's depth cannot be that of a marker of its size; empty if it can."""
    by_depth_m, by_size_m = _ranges_m(camera, view)
    if abs(by_depth_m / by_size_m - 1) <= RANGE_DISAGREEMENT[1]:
        return ""
    marker = view.marker
    return (
        f"marker {marker.id} is {by_depth_m:.3g} m away by depth, but {by_size_m:.3g} m by its size of "
        f"{marker.size_m:g} m: check depth_scale, size_m and the intrinsics"
    )


def confidence(camera: Camera, fit: MarkerFit, views: Sequence[MarkerView]) -> tuple[float, str]:
    """0..1, and what lowers it most; nothing above 0.99."""
    ratios = [by_depth_m / by_size_m for by_depth_m, by_size_m in (_ranges_m(camera, view) for view in views)]
    ratio = max(ratios, key=lambda item: abs(item - 1))
    rotation_deg = math.degrees(fit.rotation_sigma_rad)
    factors = [
        (_share(fit.corner_rms_px, CORNER_RMS_PX), f"corners lie {fit.corner_rms_px:.1f} px off the pose"),
        (_share(fit.position_sigma_m, POSITION_SIGMA_M), f"its place is known to {100 * fit.position_sigma_m:.1f} cm"),
        (_share(rotation_deg, ROTATION_SIGMA_DEG), f"its rotation is known to {rotation_deg:.0f} degrees"),
        (_share(abs(ratio - 1), RANGE_DISAGREEMENT), f"depth and a marker's size differ by {100 * (ratio - 1):+.0f} %"),
        (math.tanh((fit.rival_cost - fit.cost) / RIVAL_SCALE), "two tilts explain what is seen about as well"),
    ]
    lowest, reason = min(factors)
    return lowest, reason if lowest < 0.99 else ""


def _ranges_m(camera: Camera, view: MarkerView) -> tuple[float, float]:
    """The marker's depth as measured on its face, and as its corners and size say."""
    return float(np.median(view.points_m[:, 2])), float(view.starts(camera)[0][2, 3])


def _share(value: float, bounds: tuple[float, float]) -> float:
    none, all_ = bounds
    return float(np.clip((all_ - value) / (all_ - none), 0.0, 1.0))
