"""The table in a cloud of points: a level plane, the area that it covers, its color."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from roboprompt_client.arrays import Array

MAX_SAMPLES, NUM_TRIALS, NUM_REFINEMENTS = 4000, 60, 3
FLAT_M = 0.005  # points nearer to the plane belong to it
MAX_SLOPE = 0.05  # of the plane: tables are level
MIN_SHARE = 0.1  # of the points, for a plane to count
CELL_M = 0.02  # of the map of what the table covers
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Table:
    """z = slope_x x + slope_y y + height in the world frame, m.

    Attributes:
        plane: (3,) slope_x, slope_y, height_m.
        hull_m: (K, 2) corners of the area that it covers.
        rgb: (3,) its median color, 0..255.
    """

    plane: Array
    hull_m: Array
    rgb: Array

    def height_m(self, points_m: Array) -> Array:
        """(N,) how far points (N, 3) lie above it."""
        above: Array = points_m[:, 2] - points_m[:, :2] @ self.plane[:2] - self.plane[2]
        return above

    def level_m(self, place_m: Array) -> float:
        """Its z below a place (>= 2,)."""
        return float(place_m[:2] @ self.plane[:2] + self.plane[2])

    def holds(self, points_m: Array) -> Bools:
        """(N,) whether points (N, 3) lie above or below the area that it covers."""
        low = self.hull_m.min(axis=0)
        size = np.ceil((self.hull_m.max(axis=0) - low) / CELL_M).astype(int) + 1
        area = np.zeros(size[::-1], np.uint8)
        cv2.fillConvexPoly(area, np.rint((self.hull_m - low) / CELL_M).astype(np.int32), 1)
        cells = np.rint((points_m[:, :2] - low) / CELL_M).astype(int)
        inside = ((cells >= 0) & (cells < size)).all(axis=1)
        column, row = np.where(inside[:, None], cells, 0).T
        covered: Bools = inside & (area[row, column] > 0)
        return covered


def find_table(points_m: Array, rgb: Array) -> Table | None:
    """The level plane near most points (N, 3), whose colors are (N, 3); None if there is none."""
    if len(points_m) < NUM_TRIALS:
        return None
    rng = np.random.default_rng(0)
    some = points_m[rng.integers(0, len(points_m), MAX_SAMPLES)]
    plane = _most_supported(some, some[rng.integers(0, len(some), (NUM_TRIALS, 3))])
    if plane is None:
        return None
    for _ in range(NUM_REFINEMENTS):
        inside = some[np.abs(_above(plane, some)) < FLAT_M]
        plane = np.asarray(np.linalg.lstsq(_with_one(inside), inside[:, 2], rcond=None)[0], np.float64)
    near = np.abs(_above(plane, points_m)) < FLAT_M
    if near.mean() < MIN_SHARE:
        return None
    return Table(plane, _hull(points_m[near, :2]), np.median(rgb[near], axis=0))


def _most_supported(points_m: Array, triples_m: Array) -> Array | None:
    """Of the level planes through three points (T, 3, 3) the one near most points."""
    best, most = None, 0
    for corners in triples_m:
        if abs(np.linalg.det(_with_one(corners))) < 1e-9:
            continue
        plane = np.linalg.solve(_with_one(corners), corners[:, 2])
        support = int((np.abs(_above(plane, points_m)) < FLAT_M).sum())
        if np.hypot(*plane[:2]) < MAX_SLOPE and support > most:
            best, most = plane, support
    return best


def _above(plane: Array, points_m: Array) -> Array:
    above: Array = points_m[:, 2] - points_m[:, :2] @ plane[:2] - plane[2]
    return above


def _with_one(points_m: Array) -> Array:
    return np.column_stack([points_m[:, :2], np.ones(len(points_m))])


def _hull(places_m: Array) -> Array:
    """(K, 2) convex hull of the largest connected part."""
    low = places_m.min(axis=0)
    cells = ((places_m - low) / CELL_M).astype(int)
    size = cells.max(axis=0) + 1
    full = np.zeros(size, np.uint8)
    np.add.at(full, tuple(np.unique(cells, axis=0).T), 1)
    _, parts = cv2.connectedComponents(full)
    own = parts[tuple(cells.T)]
    largest = np.bincount(own).argmax()
    hull = cv2.convexHull(places_m[own == largest].astype(np.float32))
    corners: Array = hull[:, 0].astype(np.float64)
    return corners
