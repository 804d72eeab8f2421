"""Where to search for an object: connected parts of a scene that have its colors."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from app.perception.registered.depth_view import VOXEL_M, Index, lengths
from app.perception.registered.icp import Poses
from app.perception.registered.scene import ABOVE_TABLE_M, LitScene
from app.perception.registered.template import MAX_RISE_M, SAME_LIGHT_LAB, STANDS_WITHIN_M, Template
from roboprompt_client.types.arrays import Array

GAPS_M = (0.008, 0.016, 0.032, 0.064)  # tried cell sizes: points in neighboring cells are connected
NEIGHBOR_CELLS = 1.75  # distance from a cell within which the 26 around it lie
CONNECTED_SHARE = 0.9  # least share of a template's points in one part for a cell size to suffice
LIKE_LAB = 26.0  # tolerance of an object's colors in other light, in Lab units
# A part with fewer points of the same colors may be the object and something that touches it: it is also tried without
# the other points.
ALIKE_SHARE = 0.8
FEWEST_POINTS, MIN_SHARE = 15, 0.04  # of the template's points
MAX_CANDIDATES = 8  # the largest
WITHIN_M = VOXEL_M  # a point may lie so far outside of the hull: a lid on the rim
TOO_WIDE, MAX_PIECES = 1.2, 4  # a part wider than so many widths of the object is split into pieces


def candidates(template: Template, lit: LitScene, without: Index | None = None) -> Sequence[Index]:
    """Return the point indices of each part, the largest first, then of pieces of parts that are too large.

    Args:
        without: indices of points that belong to another object.
    """
    # Points of its colors at heights that it may have, without what it lies on.
    low_m, high_m = template.points_m[:, 2].min() - MAX_RISE_M, template.points_m[:, 2].max() + MAX_RISE_M
    if template.above_table_m > STANDS_WITHIN_M:
        low_m = template.points_m[:, 2].min() + ABOVE_TABLE_M[0]
    height_m = lit.scene.table.height_m(lit.scene.points_m) + template.bottom_m
    off_lab, _ = template.palette.query(lit.lab, distance_upper_bound=LIKE_LAB)
    is_like = np.isfinite(off_lab) & (height_m > low_m) & (height_m < high_m)
    if without is not None:
        is_like[without] = False
    like, across_m, points_m = np.flatnonzero(is_like), gap_m(template), lit.scene.points_m
    parts = _parts(template, points_m, like, across_m)
    pieces = [piece for whole in parts for piece in _pieces(template, points_m, whole)]
    for whole in parts:
        alike = whole[off_lab[whole] < SAME_LIGHT_LAB]
        if len(alike) < ALIKE_SHARE * len(whole):
            pieces += _parts(template, points_m, alike, across_m)
    return [*parts, *pieces]


def of_its_colors_within(template: Template, lit: LitScene, pose: Poses) -> Index:
    """Return the indices of points of the object's colors that lie within its convex hull in one pose."""
    places_m = pose.to_template(lit.scene.points_m)[0]
    close = np.flatnonzero(lengths(places_m - template.points_m.mean(axis=0)) < template.reach_m)
    faces = template.hull
    inside = close[(places_m[close] @ faces[:, :3].T + faces[:, 3] < WITHIN_M).all(axis=1)]
    off_lab, _ = template.palette.query(lit.lab[inside], distance_upper_bound=LIKE_LAB)
    own: Index = inside[np.isfinite(off_lab)]
    return own


def _parts(template: Template, points_m: Array, index: Index, across_m: float) -> Sequence[Index]:
    """Return the connected parts of the points `index` that are large enough, the largest first."""
    enough = max(FEWEST_POINTS, MIN_SHARE * len(template))
    if len(index) < enough:
        return []
    part = parts_of(points_m[index], across_m)
    sizes = np.bincount(part)
    largest = [number for number in np.argsort(-sizes)[:MAX_CANDIDATES] if sizes[number] >= enough]
    return [index[part == number] for number in largest]


def gap_m(template: Template) -> float:
    """Return the cell size that makes the template one part, so that a rack of two rails is found as a whole."""
    for across_m in GAPS_M[:-1]:
        if np.bincount(parts_of(template.points_m, across_m)).max() >= CONNECTED_SHARE * len(template):
            return across_m if across_m == GAPS_M[0] else 2 * across_m  # the scene's cells have another origin
    return GAPS_M[-1]


def _pieces(template: Template, points_m: Array, part: Index) -> Sequence[Index]:
    """Return a part that is too large for one object, split into pieces of about the object's width."""
    width_m = float(np.ptp(points_m[part, :2], axis=0).max())
    count = min(round(width_m / max(template.width_m, VOXEL_M)), MAX_PIECES)
    if count < 2 and width_m > TOO_WIDE * template.width_m:
        count = 2
    if count < 2:
        return []
    _, piece = kmeans2(points_m[part, :2], count, minit="++", rng=np.random.default_rng(0))
    return [part[piece == number] for number in range(count) if (piece == number).sum() >= FEWEST_POINTS]


def parts_of(points_m: Array, across_m: float = GAPS_M[0]) -> Index:
    """Return the connected part (N,) of each point."""
    cells, cell = np.unique(np.floor(points_m / across_m).astype(np.int64), axis=0, return_inverse=True)
    pairs = cKDTree(cells).query_pairs(NEIGHBOR_CELLS, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(cells), len(cells)))
    part: Index = connected_components(graph, directed=False)[1].astype(np.intp)[cell.ravel()]
    return part
