"""Where to look for an object: connected parts of a scene that have its colors."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from app.perception.registered.geometry import VOXEL_M, Index
from app.perception.registered.hypotheses import MAX_RISE_M
from app.perception.registered.scene import ABOVE_TABLE_M, LitScene
from app.perception.registered.template import STANDS_WITHIN_M, Template
from roboprompt_client.types.arrays import Array

GAPS_M = (0.008, 0.016, 0.032, 0.064)  # between two parts
NEIGHBOR_CELLS = 1.75  # from a cell to the 26 around it
CONNECTED_SHARE = 0.9  # of an object's points that are one part
LIKE_LAB, SAME_LAB = 26.0, 12.0  # from a color of the object in another light, or in the same; Lab units
ALIKE_SHARE = 0.8  # a part of which less has the same colors is looked at without the rest: the object may touch that
FEWEST_POINTS, MIN_SHARE = 15, 0.04  # of the template's points
MAX_CANDIDATES = 8  # the largest
TOO_WIDE, MAX_PIECES = 1.2, 4  # times an object's width: several that touch


def candidates(template: Template, lit: LitScene, without: Index | None = None) -> Sequence[Index]:
    """Indices of the scene's points in each part, the largest part first; then in pieces of parts that are too large.

    Args:
        without: points that something else explains.
    """
    # Of its colors, and as high above the table as some of it may be; but not what it lies on.
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
        alike = whole[off_lab[whole] < SAME_LAB]
        if len(alike) < ALIKE_SHARE * len(whole):
            pieces += _parts(template, points_m, alike, across_m)
    return [*parts, *pieces]


def _parts(template: Template, points_m: Array, index: Index, across_m: float) -> Sequence[Index]:
    """The connected parts of the points `index` that are large enough, the largest first."""
    enough = max(FEWEST_POINTS, MIN_SHARE * len(template))
    if len(index) < enough:
        return []
    part = parts_of(points_m[index], across_m)
    sizes = np.bincount(part)
    largest = [number for number in np.argsort(-sizes)[:MAX_CANDIDATES] if sizes[number] >= enough]
    return [index[part == number] for number in largest]


def gap_m(template: Template) -> float:
    """Across which the template is one part: a rack of two rails is found as a whole."""
    for across_m in GAPS_M[:-1]:
        if np.bincount(parts_of(template.points_m, across_m)).max() >= CONNECTED_SHARE * len(template):
            return across_m if across_m == GAPS_M[0] else 2 * across_m  # cells begin elsewhere in the scene
    return GAPS_M[-1]


def _pieces(template: Template, points_m: Array, part: Index) -> Sequence[Index]:
    """A part that is too large for one object in as many pieces as it may be objects that touch."""
    width_m = float(np.ptp(points_m[part, :2], axis=0).max())
    count = min(round(width_m / max(template.width_m, VOXEL_M)), MAX_PIECES)
    if count < 2 and width_m > TOO_WIDE * template.width_m:
        count = 2
    if count < 2:
        return []
    _, piece = kmeans2(points_m[part, :2], count, minit="++", rng=np.random.default_rng(0))
    return [part[piece == number] for number in range(count) if (piece == number).sum() >= FEWEST_POINTS]


def parts_of(points_m: Array, across_m: float = GAPS_M[0]) -> Index:
    """(N,) which connected part each point belongs to."""
    cells, cell = np.unique(np.floor(points_m / across_m).astype(np.int64), axis=0, return_inverse=True)
    pairs = cKDTree(cells).query_pairs(NEIGHBOR_CELLS, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(cells), len(cells)))
    part: Index = connected_components(graph, directed=False)[1].astype(np.intp)[cell.ravel()]
    return part
