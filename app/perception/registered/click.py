"""Marks on an object -> its mask in every camera.

A click grows in depth over the table plane: everything that is connected above it. Where that becomes too large, since
things touch, it grows in color, too. A click on something else takes away what is nearer to it than to the object's
clicks, along the surface; a box bounds what a mask may hold.
"""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from app.perception.registered.candidates import parts_of
from app.perception.registered.cloud import VOXEL_M, Index
from app.perception.registered.marks import Marks, Mask, clicked_points, in_the_middle, inside
from app.perception.registered.scene import ABOVE_TABLE_M, Scene, to_lab
from app.pipeline.geometry import pixels_to_world
from roboprompt_client.arrays import Array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.errors import InvalidInputError

MAX_SPAN_M = 0.35  # of an object
ALIKE_LAB = 30.0  # from the clicked color
NEIGHBORS_M = 0.012  # between points that a way along the surface may connect
# What a change of color, and of the surface's direction, adds to the length of a way.
M_PER_LAB, M_PER_TURN = 0.002, 0.02


def masks_from_marks(scene: Scene, frames: Sequence[RgbdFrame], marks: Marks) -> dict[str, Mask]:
    """By camera the mask (H, W) of what was marked.

    Args:
        scene: of the frames.

    Raises:
        InvalidInputError: naming the camera, if a mark is on nothing that stands above the table.
    """
    by_name = {frame.camera.name: frame for frame in frames}
    behind = [inside(scene, by_name[name], box) for name, box in marks.boxes.items()]
    among = np.flatnonzero(np.all(behind, axis=0)) if behind else np.arange(len(scene.points_m))
    clicked = clicked_points(scene, by_name, marks.clicks, "clicks")
    if not clicked and len(among):
        clicked = [in_the_middle(scene, by_name[name], box, among) for name, box in marks.boxes.items()]
    off = clicked_points(scene, by_name, marks.clicks_off, "clicks_off")
    own = _grown(scene, among, clicked, off)
    _check(scene, own, next(f"{what}[{name}]" for what in ("clicks", "boxes") for name in getattr(marks, what)))
    is_own = np.zeros(len(scene.points_m), bool)
    is_own[own] = True
    tree = cKDTree(scene.points_m)
    return {name: _mask(scene, tree, is_own, frame) for name, frame in by_name.items()}


def _check(scene: Scene, own: Index, where: str) -> None:
    if not len(own):
        raise InvalidInputError(where, "leaves nothing of the object", "clicks inside the boxes, and off it elsewhere")
    span_m = _span_m(scene.points_m[own])
    if span_m > MAX_SPAN_M:
        message = f"grows to {100 * span_m:.0f} cm, at most {100 * MAX_SPAN_M:.0f}: it touches something alike"
        raise InvalidInputError(where, message, "a click on what it touches, to take that away; or a box around it")


def _grown(scene: Scene, among: Index, clicked: Sequence[Index], off: Sequence[Index]) -> Index:
    """What is connected with what was clicked on, without what belongs to the clicks `off`."""
    parts = [_grown_from(scene, among, seeds, by_color=not off) for seeds in clicked]
    own = np.unique(np.concatenate([among[:0], *parts]))
    return own[_is_nearer(scene, own, np.concatenate(clicked), np.concatenate(off))] if off else own


def _grown_from(scene: Scene, among: Index, seeds: Index, *, by_color: bool) -> Index:
    index = _connected(scene.points_m, among, seeds)
    if not by_color or _span_m(scene.points_m[index]) <= MAX_SPAN_M:
        return index
    lab = to_lab(scene.rgb)
    alike = np.linalg.norm(lab - np.median(lab[seeds], axis=0), axis=1) < ALIKE_LAB
    return _connected(scene.points_m, among[alike[among]], seeds)


def _connected(points_m: Array, among: Index, seeds: Index) -> Index:
    part = parts_of(points_m[among])
    return among[np.isin(part, part[np.isin(among, seeds)])]


def _span_m(points_m: Array) -> float:
    return float(np.ptp(points_m, axis=0).max()) if len(points_m) else 0.0


def _is_nearer(scene: Scene, index: Index, on: Index, off: Index) -> Mask:
    """(len(index),) which points are nearer to the points `on` than to `off`, along the surface."""
    points_m, lab, normals = scene.points_m[index], to_lab(scene.rgb[index]), scene.normals[index]
    one, other = cKDTree(points_m).query_pairs(NEIGHBORS_M, output_type="ndarray").T
    way_m = np.linalg.norm(points_m[one] - points_m[other], axis=1)
    way_m += M_PER_LAB * np.linalg.norm(lab[one] - lab[other], axis=1)
    way_m += M_PER_TURN * (1 - np.einsum("ni,ni->n", normals[one], normals[other]))
    graph = coo_array((way_m, (one, other)), shape=(len(index), len(index)))
    seeds = [np.flatnonzero(np.isin(index, those)) for those in (np.setdiff1d(on, off), off)]
    ours_m, theirs_m = (
        dijkstra(graph, directed=False, indices=those, min_only=True) if len(those) else np.full(len(index), np.inf)
        for those in seeds
    )
    nearer: Mask = np.isfinite(ours_m) & (ours_m < theirs_m)
    return nearer


def _mask(scene: Scene, tree: cKDTree, is_own: Mask, frame: RgbdFrame) -> Mask:
    """The pixels of a camera whose nearest points are the object's."""
    assert frame.depth_m is not None
    mask: Mask = np.zeros(frame.depth_m.shape, bool)
    pixels, depth_m = frame.camera.project(scene.points_m[is_own])
    before = depth_m > 0
    if not before.any():
        return mask
    left, top = np.clip(np.floor(pixels[before].min(axis=0)) - 3, 0, mask.shape[::-1]).astype(int)
    right, bottom = np.clip(np.ceil(pixels[before].max(axis=0)) + 4, 0, mask.shape[::-1]).astype(int)
    rows, columns = np.nonzero(frame.depth_m[top:bottom, left:right])
    rows, columns = rows + top, columns + left
    points_m = pixels_to_world(frame.camera, rows, columns, frame.depth_m[rows, columns])
    distance_m, nearest = tree.query(points_m, distance_upper_bound=2 * VOXEL_M)
    own = np.isfinite(distance_m) & (scene.table.height_m(points_m) > ABOVE_TABLE_M[0])
    own[own] = is_own[nearest[own]]
    mask[rows[own], columns[own]] = True
    return mask
