"""Where to look for an object: connected parts of a scene that have its colors."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from app.perception.registered.cloud import VOXEL_M, Index
from app.perception.registered.scene import LitScene
from app.perception.registered.template import Template
from roboprompt_client.arrays import Array

GAP_M = 0.008  # between two parts
NEIGHBOR_CELLS = 1.75  # from a cell to the 26 around it
LIKE_LAB = 26.0  # a color of the object, in Lab units
FEWEST_POINTS, LEAST_SHARE = 15, 0.04  # of the template's points
MOST_CANDIDATES = 8  # the largest
TOO_WIDE, MOST_PIECES = 1.2, 4  # times an object's width: several that touch


def candidates(template: Template, lit: LitScene, without: Index | None = None) -> Sequence[Index]:
    """Indices of the scene's points in each part, the largest part first.

    Args:
        without: points that something else explains.
    """
    distance, _ = template.palette.query(lit.lab, distance_upper_bound=LIKE_LAB)
    is_like = np.isfinite(distance)
    if without is not None:
        is_like[without] = False
    like = np.flatnonzero(is_like)
    if len(like) < FEWEST_POINTS:
        return []
    part = parts_of(lit.scene.points_m[like])
    sizes = np.bincount(part)
    enough = max(FEWEST_POINTS, LEAST_SHARE * len(template))
    order = [number for number in np.argsort(-sizes) if sizes[number] >= enough]
    parts = [like[part == number] for number in order[:MOST_CANDIDATES]]
    pieces = [piece for whole in parts for piece in _pieces(template, lit.scene.points_m, whole)]
    return [*parts, *(piece for piece in pieces if len(piece) >= enough)]


def _pieces(template: Template, points_m: Array, part: Index) -> Sequence[Index]:
    """A part that is too large for one object in as many pieces as it may be objects that touch."""
    width_m = float(np.ptp(points_m[part, :2], axis=0).max())
    count = min(round(width_m / max(template.width_m, VOXEL_M)), MOST_PIECES)
    if count < 2 and width_m > TOO_WIDE * template.width_m:
        count = 2
    if count < 2:
        return []
    _, piece = kmeans2(points_m[part, :2], count, minit="++", rng=np.random.default_rng(0))
    return [part[piece == number] for number in range(count)]


def parts_of(points_m: Array) -> Index:
    """(N,) which connected part each point belongs to."""
    cells, cell = np.unique(np.floor(points_m / GAP_M).astype(np.int64), axis=0, return_inverse=True)
    pairs = cKDTree(cells).query_pairs(NEIGHBOR_CELLS, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(cells), len(cells)))
    part: Index = connected_components(graph, directed=False)[1].astype(np.intp)[cell.ravel()]
    return part
