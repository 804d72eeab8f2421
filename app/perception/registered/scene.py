"""One observation of all cameras: the table and the points above it, prepared once for all objects of a request."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import Delaunay

from app.perception.frame_checks import are_swapped, check_cameras, check_level
from app.perception.registered.depth_view import FARTHEST_M, Bools, DepthView, Index, RgbImage, normals_of, thinned
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame

ABOVE_TABLE_M = (0.006, 0.6)
POINTS_WIDTH_PX = 400  # images are subsampled to this width for points
LIGHTNESS = 0.4  # its weight in color distances: shading changes it
DARKEST_RGB = 5.0  # a darker table does not indicate the light
# A table whose color has changed by less is the taught one in the same light; one whose color has changed by more, in
# brightness or between two of red, green and blue, is another one: no lamp does that.
SAME_TABLE, MAX_BRIGHTNESS, MAX_TINT = 1.05, 3.0, 1.5
LAB_OFFSET, LAB_SCALE = np.array([0.0, 128, 128]), np.array([LIGHTNESS * 100 / 255, 1, 1])
MAX_SAMPLES, NUM_TRIALS, NUM_REFINEMENTS = 4000, 60, 3
FLAT_M = 0.005  # points nearer to the table's plane belong to it
MAX_SLOPE = 0.05  # of the plane: tables are level
LEAST_APART_M = 0.05  # of points that define a plane
ABOVE_FLOOR_M = 0.3  # least height of a table
MIN_SHARE = 0.1  # least share of points in the plane
CELL_M = 0.02  # cell of the map of the table's area
SAME_SURFACE_M = 0.009  # a pixel shows a point if their depths differ by less


@dataclass(frozen=True, eq=False)
class Table:
    """z = slope_x x + slope_y y + height in the world frame, m.

    Attributes:
        plane: (3,) slope_x, slope_y, height_m.
        hull_m: (K, 2) corners of its area.
        rgb: (3,) its median color, 0..255.
    """

    plane: Array
    hull_m: Array
    rgb: Array

    def height_m(self, points_m: Array) -> Array:
        """Return the heights (N,) of points (N, 3) above it."""
        return _above(self.plane, points_m)

    def level_m(self, place_m: Array) -> float:
        """Return its z at a place (2,) or (3,)."""
        return float(place_m[:2] @ self.plane[:2] + self.plane[2])

    def holds(self, points_m: Array) -> Bools:
        """Return whether points (N, 3) lie above or below its area, (N,)."""
        covered: Bools = Delaunay(self.hull_m).find_simplex(points_m[:, :2]) >= 0
        return covered


def find_table(points_m: Array, rgb: Array) -> Table | None:
    """Return the level plane with most of the points (N, 3), whose colors are (N, 3), or None.

    A floor below it may show more points: a table is at least `ABOVE_FLOOR_M` higher and shows half as many.
    """
    if len(points_m) < NUM_TRIALS:
        return None
    rng = np.random.default_rng(0)
    some = points_m[rng.integers(0, len(points_m), MAX_SAMPLES)]
    planes = _level_planes(some, rng)
    if not len(planes):
        return None
    plane = _refined(planes[_most_supported(planes, some)], some)
    near = np.abs(_above(plane, points_m)) < FLAT_M
    if near.mean() < MIN_SHARE:
        return None
    return Table(plane, _hull(points_m[near, :2]), np.median(rgb[near], axis=0))


def _level_planes(points_m: Array, rng: np.random.Generator) -> Array:
    """Return level planes (P, 3) through triples of points (N, 3) that may lie in one: RANSAC's hypotheses.

    Triples of any points would seldom lie in a table that fills a fifth of the images.
    """
    firsts_m = points_m[rng.integers(0, len(points_m), NUM_TRIALS)]
    offsets_m = points_m - firsts_m[:, None]
    apart_m = np.hypot(offsets_m[..., 0], offsets_m[..., 1])
    may_be_level = (apart_m > LEAST_APART_M) & (np.abs(offsets_m[..., 2]) < MAX_SLOPE * apart_m)
    drawn = np.where(may_be_level, rng.random(may_be_level.shape), 0)
    seconds, thirds = np.argpartition(drawn, -2, axis=1)[:, -2:].T
    trials = np.arange(NUM_TRIALS)
    normals = np.cross(offsets_m[trials, seconds], offsets_m[trials, thirds])
    is_level = np.hypot(normals[:, 0], normals[:, 1]) < MAX_SLOPE * np.abs(normals[:, 2])
    slopes = -normals[is_level, :2] / normals[is_level, 2:]
    return np.column_stack([slopes, firsts_m[is_level, 2] - (slopes * firsts_m[is_level, :2]).sum(axis=1)])


def _most_supported(planes: Array, points_m: Array) -> int:
    """Return the index of the plane (P, 3) with most of the points (N, 3), or of the table above that floor."""
    counts = (np.abs(_above(planes, points_m[:, None])) < FLAT_M).sum(axis=0)
    levels_m = planes[:, :2] @ np.median(points_m[:, :2], axis=0) + planes[:, 2]
    best = int(counts.argmax())
    is_above = (levels_m > levels_m[best] + ABOVE_FLOOR_M) & (counts > counts[best] / 2)
    return int(np.where(is_above, counts, 0).argmax()) if is_above.any() else best


def _refined(plane: Array, points_m: Array) -> Array:
    """Return the plane (3,) that fits its points best (least squares)."""
    for _ in range(NUM_REFINEMENTS):
        inside = points_m[np.abs(_above(plane, points_m)) < FLAT_M]
        with_one = np.column_stack([inside[:, :2], np.ones(len(inside))])
        plane = np.asarray(np.linalg.lstsq(with_one, inside[:, 2], rcond=None)[0], np.float64)
    return plane


def _above(plane: Array, points_m: Array) -> Array:
    """Return the heights of points (..., 3) above a plane (3,), or above each of (P, 3)."""
    slope_x, slope_y, height_m = np.moveaxis(plane, -1, 0)
    above: Array = points_m[..., 2] - points_m[..., 0] * slope_x - points_m[..., 1] * slope_y - height_m
    return above


def _hull(places_m: Array) -> Array:
    """Return the convex hull (K, 2) of the largest connected part."""
    low = places_m.min(axis=0)
    cells = ((places_m - low) / CELL_M).astype(int)
    size = cells.max(axis=0) + 1
    full = np.zeros(size, np.uint8)
    full[tuple(cells.T)] = 1
    _, parts = cv2.connectedComponents(full)
    own = parts[tuple(cells.T)]
    largest = np.bincount(own).argmax()
    hull = cv2.convexHull(places_m[own == largest].astype(np.float32))
    return np.asarray(hull[:, 0], np.float64)


@dataclass(frozen=True, eq=False)
class Scene:
    """The table and the points above it, in the world frame.

    Attributes:
        points_m, normals: (N, 3) above the table, one point per voxel.
        rgb: (N, 3) their colors, 0..255.
    """

    views: tuple[DepthView, ...]
    table: Table
    points_m: Array
    rgb: Array
    normals: Array

    @classmethod
    def of(cls, frames: Sequence[RgbdFrame]) -> "Scene":
        """Return the scene of frames with color and depth.

        Raises:
            InvalidInputError: if there is no frame, a frame's images are unusable, or no camera sees a level table.
        """
        check_cameras(frames)
        for frame in frames:
            check_level(frame)
        views = tuple(map(DepthView.of, frames))
        points_m, rgb, eyes_m = (np.concatenate(parts) for parts in zip(*map(_points, views), strict=True))
        table = find_table(points_m, rgb)
        if table is None:
            seen = ", ".join(f"depth_{view.camera.name} ({np.mean(view.depth_m == 0):.0%} unknown)" for view in views)
            remedy = "images in which a level table fills at least a tenth; camera_to_world in a world whose z is up"
            raise InvalidInputError("cameras", f"no level surface is seen in {seen}", remedy)
        height_m = table.height_m(points_m)
        up = (height_m > ABOVE_TABLE_M[0]) & (height_m < ABOVE_TABLE_M[1])
        up[up] = table.holds(points_m[up])
        points_m, rgb, eyes_m = thinned(points_m[up], rgb[up], eyes_m[up])
        return cls(views, table, points_m, rgb, normals_of(points_m, eyes_m))

    def masked(self, ids: Sequence[int] | None = None) -> Bools:
        """Return which points (N,) a camera sees within its mask, of the ids; None: of any."""
        inside = np.zeros(len(self.points_m), np.bool_)
        for view in self.views:
            if view.mask is not None:
                seen = view.look_up(self.points_m)
                id_ = view.mask[seen.rows, seen.columns]
                is_own = id_ != 0 if ids is None else np.isin(id_, ids)
                inside |= is_own & (np.abs(seen.depth_m - seen.point_m) < SAME_SURFACE_M)
        return inside

    def pixel_m(self, place_m: Array) -> float:
        """Return the width of a pixel at a place (3,), the median of the cameras."""
        return float(np.median([np.linalg.norm(view.eye_m - place_m) / view.camera.fx_px for view in self.views]))

    def table_rgb_in(self, view: DepthView) -> Array | None:
        """Return the median color (3,) of the table in one camera, 0..255; None if it shows none of it."""
        points_m, rgb, _ = _points(view)
        on_table = np.abs(self.table.height_m(points_m)) < FLAT_M
        return np.median(rgb[on_table], axis=0) if on_table.any() else None

    def in_lights_of(self, table_rgb: Array) -> "Sequence[LitScene]":
        """Return the scene as it would look in the light in which a table had the color (3,), 0..255.

        If the table has another color now, either the light or the table has changed: one scene for each that may be,
        that of changed light first.
        """
        gain = np.maximum(table_rgb, DARKEST_RGB) / np.maximum(self.table.rgb, DARKEST_RGB)
        change, tint = np.exp(np.abs(np.log(gain)).max()), gain.max() / gain.min()
        may_be_light = bool(change < MAX_BRIGHTNESS and tint < MAX_TINT)
        may_be_table = bool(change > SAME_TABLE and not are_swapped(table_rgb, self.table.rgb))
        gains = [gain] * (may_be_light or not may_be_table) + [np.ones(3)] * may_be_table
        return [self._times(item) for item in gains]

    def _times(self, gain: Array) -> "LitScene":
        brighter = np.clip(np.arange(256)[:, None] * gain + 0.5, 0, 255).astype(np.uint8)[None]
        images = (cv2.cvtColor(cv2.LUT(view.rgb, brighter), cv2.COLOR_RGB2LAB) for view in self.views)
        return LitScene(self, gain, tuple(np.asarray(image, np.uint8) for image in images), to_lab(self.rgb, gain))


@dataclass(frozen=True, eq=False)
class LitScene:
    """A scene, its colors scaled to the light of a template.

    Attributes:
        gain: (3,) factor of red, green and blue.
        images: per view (H, W, 3) uint8 in OpenCV's Lab; see `lab_at`.
        lab: (N, 3) of the points.
    """

    scene: Scene
    gain: Array
    images: tuple[RgbImage, ...]
    lab: Array

    def lab_at(self, number: int, rows: Index, columns: Index) -> Array:
        """Return the colors (..., 3) of pixels of view `number`."""
        return _scaled_lab(self.images[number][rows, columns])


def to_lab(rgb: Array, gain: Array | float = 1.0) -> Array:
    """Return comparable colors (N, 3) of rgb (N, 3), 0..255, times a gain (3,): Lab with lightness weighted down."""
    pixels = np.clip(rgb * gain + 0.5, 0, 255).astype(np.uint8)
    return _scaled_lab(cv2.cvtColor(pixels[None], cv2.COLOR_RGB2LAB)[0]) if len(pixels) else np.zeros((0, 3))


def _scaled_lab(lab_uint8: RgbImage) -> Array:
    """Return comparable colors (..., 3) from OpenCV's 8-bit Lab."""
    scaled: Array = (lab_uint8 - LAB_OFFSET) * LAB_SCALE
    return scaled


def _points(view: DepthView) -> tuple[Array, Array, Array]:
    """Return points, colors and camera positions, each (N, 3), on a grid of pixels."""
    step = max(1, round(view.depth_m.shape[1] / POINTS_WIDTH_PX))
    depth_m = view.depth_m[::step, ::step]
    rows, columns = np.nonzero((depth_m > 0) & (depth_m < FARTHEST_M))
    rows, columns = step * rows, step * columns
    points_m = view.camera.deproject(rows, columns, view.depth_m[rows, columns])
    return points_m, view.rgb[rows, columns].astype(np.float64), np.broadcast_to(view.eye_m, points_m.shape)
