"""Pixels of an object in an image -> what a fit needs of them: surface points, outline, ground."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.perception.cuboid.pieces import CROSS, Bools, Piece, eroded, inner
from app.pipeline.geometry import pixels_to_world
from roboprompt_client.arrays import Array
from roboprompt_client.camera import Camera, RgbdFrame
from roboprompt_client.flat_surface import DEPTH_SIGMA_AT_1_M

DEPTH_SIGMA_FLOOR_M = 0.001
INDEPENDENT_PIXELS = 12  # neighboring depths err alike: so many count as one
MAX_POINTS, MAX_RAYS = 150, 120
MARGIN_PX = 16  # around the object, to see what it stands on
PROBE_PX = 3  # how far outside of the outline its neighbor is looked at
BEHIND_M = 0.015  # what is farther than the object by this much is behind it
GROUND_BIN_M = 0.004
GROUND_NEAR_M = 0.012


@dataclass(frozen=True, eq=False)
class View:
    """What one camera sees of an object.

    Attributes:
        points_m: (N, 3) of its surface in the world frame.
        point_sigma_m: of the points' depth, as much as one of the N counts.
        eye_m: (3,) the camera's place.
        rays: (M, 3) unit vectors in the world frame from the eye along the object's outline.
        footprint_m: what a pixel covers at the object's distance.
        ground_m: the height of what surrounds it, or None.
    """

    points_m: Array
    point_sigma_m: float
    eye_m: Array
    rays: Array
    footprint_m: float
    ground_m: float | None

    def thinned(self, factor: int) -> "View":
        """Every `factor`-th point and ray."""
        points_m, rays = self.points_m[::factor], self.rays[::factor]
        return View(points_m, self.point_sigma_m, self.eye_m, rays, self.footprint_m, self.ground_m)


def view_of(frame: RgbdFrame, piece: Piece) -> View:
    """What the camera sees of the piece."""
    assert frame.depth_m is not None
    camera = frame.camera
    left, top = max(piece.left_px - MARGIN_PX, 0), max(piece.top_px - MARGIN_PX, 0)
    right = piece.left_px + piece.mask.shape[1] + MARGIN_PX
    bottom = piece.top_px + piece.mask.shape[0] + MARGIN_PX
    depth_m = frame.depth_m[top:bottom, left:right]
    mask = piece.mask_in(left, top, depth_m.shape)
    rows, columns = np.indices(mask.shape).reshape(2, -1)
    points_m = pixels_to_world(camera, rows + top, columns + left, depth_m.ravel()).reshape(*mask.shape, 3)
    surface_m = points_m[inner(mask) & (depth_m > 0)]
    ground_m = _ground_m(points_m[~mask & (depth_m > 0)][:, 2], surface_m[:, 2])
    edges = _outline(mask, depth_m, points_m[..., 2], ground_m)
    eye_m = camera.camera_to_world[:3, 3]
    stride = max(1, round(len(surface_m) / MAX_POINTS))
    return View(
        surface_m[::stride],
        _sigma_m(piece.distance_m) * max(1.0, np.sqrt(INDEPENDENT_PIXELS / stride)),
        eye_m,
        _rays(camera, edges + np.array([top, left]))[:: max(1, round(len(edges) / MAX_RAYS))],
        piece.distance_m / camera.fx_px,
        ground_m,
    )


def _sigma_m(distance_m: float) -> float:
    return float(np.hypot(DEPTH_SIGMA_AT_1_M * distance_m**2, DEPTH_SIGMA_FLOOR_M))


def _ground_m(around_m: Array, object_m: Array) -> float | None:
    """The height that most of what surrounds the object has; None if there is no such level."""
    below = around_m[around_m < np.median(object_m) + GROUND_NEAR_M]
    if len(below) < 50:
        return None
    counts, edges = np.histogram(below, np.arange(below.min(), below.max() + 2 * GROUND_BIN_M, GROUND_BIN_M))
    peak = edges[np.argmax(counts)] + GROUND_BIN_M / 2
    near = below[np.abs(below - peak) < GROUND_NEAR_M]
    return float(np.median(near)) if len(near) > 0.2 * len(below) else None


def _outline(mask: Bools, depth_m: npt.NDArray[np.float32], height_m: Array, ground_m: float | None) -> Array:
    """(M, 2) row and column of the edges between the object and what is behind or below it.

    An edge towards what stands before or on it is not its outline.
    """
    found = [np.zeros((0, 2))]
    object_depth_m = float(np.median(depth_m[mask & (depth_m > 0)]))
    rim = np.nonzero(mask & ~eroded(mask, CROSS))
    for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        rows, columns = rim
        inside = (rows + down >= 0) & (rows + down < mask.shape[0])
        inside &= (columns + right >= 0) & (columns + right < mask.shape[1])
        rows, columns = rows[inside], columns[inside]
        edge = ~mask[rows + down, columns + right]
        rows, columns = rows[edge], columns[edge]
        probe_rows = np.clip(rows + PROBE_PX * down, 0, mask.shape[0] - 1)
        probe_columns = np.clip(columns + PROBE_PX * right, 0, mask.shape[1] - 1)
        depth = depth_m[rows, columns]
        behind = depth_m[probe_rows, probe_columns] > np.where(depth > 0, depth, object_depth_m) + BEHIND_M
        if ground_m is not None:
            behind |= np.abs(height_m[probe_rows, probe_columns] - ground_m) < GROUND_NEAR_M
        behind &= ~mask[probe_rows, probe_columns]
        found.append(np.column_stack([rows + down / 2, columns + right / 2])[behind])
    return np.concatenate(found)


def _rays(camera: Camera, pixels: Array) -> Array:
    """(M, 3) unit vectors in the world frame through (row, column) pixels."""
    rows, columns = pixels[:, 0], pixels[:, 1]
    ends_m = pixels_to_world(camera, rows, columns, np.ones(len(pixels)))
    offsets = ends_m - camera.camera_to_world[:3, 3]
    rays: Array = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    return rays
