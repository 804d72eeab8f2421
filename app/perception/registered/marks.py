"""What a person marks in pictures of an object -> its mask in every camera.

A click grows in depth over the table plane: everything that is connected above it. Where that becomes too large, since
things touch, it grows in color, too. A click on something else takes away what is nearer to it than to the object's
clicks, along the surface; a box bounds what a mask may hold.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import atan2, degrees

import cv2
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from app.perception.registered.candidates import parts_of
from app.perception.registered.depth_view import VOXEL_M, Bools, Index
from app.perception.registered.scene import ABOVE_TABLE_M, Scene, to_lab
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame

NEAR_CLICK_M = 0.015  # from the clicked pixel to a point above the table
SEARCH_PX = 4  # around the click for a pixel with depth
BOX_MARGIN_M = 0.006  # around a box: cameras are not calibrated exactly, and sides are seen edge-on
OUTLINE_PX = 0.8  # how far an outline may be off a mask
MIN_ARROW_M = 0.01
MAX_ARROW_M = 0.5  # a ray that hardly meets the arrow's height ends far away
MAX_SPAN_M = 0.35  # of an object
ALIKE_LAB = 30.0  # from the clicked color
NEIGHBORS_M = 0.012  # between points that a way along the surface may connect
# What a change of color, and of the surface's direction, adds to the length of a way.
M_PER_LAB, M_PER_TURN = 0.002, 0.02
HELP = "another pixel of it; or a box or a polygon around it"
Mask = Bools
Pixel = tuple[float, float]
Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Marks:
    """What a person marked, by camera; of `clicks` and `boxes` one is enough.

    Attributes:
        clicks: pixels (x, y) on the object.
        clicks_off: pixels on what is not the object.
        boxes: (left, top, right, bottom) in pixels around the object.
    """

    clicks: Mapping[str, Sequence[Pixel]] = field(default_factory=dict)
    clicks_off: Mapping[str, Sequence[Pixel]] = field(default_factory=dict)
    boxes: Mapping[str, Box] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return any(self.clicks.values()) or bool(self.boxes)


def masks_from_marks(scene: Scene, frames: Sequence[RgbdFrame], marks: Marks) -> dict[str, Mask]:
    """By camera the mask (H, W) of what was marked.

    Args:
        scene: of the frames.

    Raises:
        InvalidInputError: naming the camera, if a mark is on nothing that stands above the table.
    """
    by_name = {frame.camera.name: frame for frame in frames}
    behind = [_inside(scene, by_name[name], box) for name, box in marks.boxes.items()]
    among = np.flatnonzero(np.all(behind, axis=0)) if behind else np.arange(len(scene.points_m))
    clicked, off = (
        [
            _near(scene, by_name[name], click, f"{what}[{name}]")
            for name, clicks in getattr(marks, what).items()
            for click in clicks
        ]
        for what in ("clicks", "clicks_off")
    )
    if not clicked and len(among):
        clicked = [_in_the_middle(scene, by_name[name], box, among) for name, box in marks.boxes.items()]
    own = _grown(scene, among, clicked, off)
    where = next(f"{what}[{name}]" for what in ("clicks", "boxes") for name in getattr(marks, what))
    if not len(own):
        raise InvalidInputError(where, "leaves nothing of the object", "clicks inside the boxes, and off it elsewhere")
    if (span_m := _span_m(scene.points_m[own])) > MAX_SPAN_M:
        message = f"grows to {100 * span_m:.0f} cm, at most {100 * MAX_SPAN_M:.0f}: it touches something alike"
        raise InvalidInputError(where, message, "a click on what it touches, to take that away; or a box around it")
    is_own = np.zeros(len(scene.points_m), bool)
    is_own[own] = True
    tree = cKDTree(scene.points_m)
    return {name: _mask(scene, tree, is_own, frame) for name, frame in by_name.items()}


def _near(scene: Scene, frame: RgbdFrame, click: Pixel, where: str) -> Index:
    """The indices of the points next to a click."""
    place_m = _point_m(frame, click, where)
    near = np.flatnonzero(np.linalg.norm(scene.points_m - place_m, axis=1) < NEAR_CLICK_M)
    if not len(near):
        above_cm = 100 * float(scene.table.height_m(place_m[None])[0])
        message = f"is {[*click]}, which shows a point {above_cm:.1f} cm above the table: no object stands out there"
        raise InvalidInputError(where, message, HELP)
    return near


def _inside(scene: Scene, frame: RgbdFrame, box: Box) -> Mask:
    """(N,) which points lie behind the pixels of the box."""
    pixels, depth_m = frame.camera.project(scene.points_m)
    margin_px = (frame.camera.fx_px * BOX_MARGIN_M / np.where(depth_m > 0, depth_m, np.inf))[:, None]
    held = (pixels > np.subtract(box[:2], margin_px)) & (pixels < np.add(box[2:], margin_px))
    behind: Mask = (depth_m > 0) & held.all(axis=1)
    if not behind.any():
        message = f"is {list(box)}, where nothing stands on the table"
        raise InvalidInputError(f"boxes[{frame.camera.name}]", message, "[left, top, right, bottom] around the object")
    return behind


def _in_the_middle(scene: Scene, frame: RgbdFrame, box: Box, among: Index) -> Index:
    """(1,) index of the point that is seen next to the middle of the box."""
    pixels, depth_m = frame.camera.project(scene.points_m[among])
    off_px = np.hypot(*(pixels - np.reshape(box, (2, 2)).mean(axis=0)).T)
    seen_there = np.flatnonzero(off_px <= off_px.min() + SEARCH_PX)
    return among[seen_there[[int(depth_m[seen_there].argmin())]]]


def _grown(scene: Scene, among: Index, clicked: Sequence[Index], off: Sequence[Index]) -> Index:
    """What is connected with what was clicked on, without what belongs to the clicks `off`."""
    parts = []
    for seeds in clicked:
        part = _connected(scene.points_m, among, seeds)
        if not off and _span_m(scene.points_m[part]) > MAX_SPAN_M:
            lab = to_lab(scene.rgb)
            alike = np.linalg.norm(lab - np.median(lab[seeds], axis=0), axis=1) < ALIKE_LAB
            part = _connected(scene.points_m, among[alike[among]], seeds)
        parts.append(part)
    own = np.unique(np.concatenate([among[:0], *parts]))
    return own[_is_nearer(scene, own, np.concatenate(clicked), np.concatenate(off))] if off else own


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
    points_m = frame.camera.deproject(rows, columns, frame.depth_m[rows, columns])
    distance_m, nearest = tree.query(points_m, distance_upper_bound=2 * VOXEL_M)
    own = np.isfinite(distance_m) & (scene.table.height_m(points_m) > ABOVE_TABLE_M[0])
    own[own] = is_own[nearest[own]]
    mask[rows[own], columns[own]] = True
    return mask


def yaw_of_arrow_deg(frame: RgbdFrame, tail: Pixel, head: Pixel) -> float:
    """Where a level arrow points about the vertical, from x to y, that is drawn from one pixel to another.

    Its tail is on the object, whose height it has.

    Raises:
        InvalidInputError: naming the camera, if the tail has no depth, or no such arrow is long enough to be sure.
    """
    where = f"arrows[{frame.camera.name}]"
    tail_m = _point_m(frame, tail, where)
    eye_m = frame.camera.camera_to_world[:3, 3]
    ray = frame.camera.deproject([head[1]], [head[0]], [1.0])[0] - eye_m
    reach = (tail_m[2] - eye_m[2]) / ray[2] if ray[2] else np.inf
    way_m = eye_m + reach * ray - tail_m
    if not (reach > 0 and MIN_ARROW_M <= np.hypot(*way_m[:2]) <= MAX_ARROW_M):
        remedy = f"an arrow of {100 * MIN_ARROW_M:.0f} to {100 * MAX_ARROW_M:.0f} cm in a camera that looks down"
        raise InvalidInputError(where, f"is {[*tail]} to {[*head]}, which is no such arrow on the table", remedy)
    return degrees(atan2(way_m[1], way_m[0]))


def _point_m(frame: RgbdFrame, pixel: Pixel, where: str) -> Array:
    """(3,) what the camera sees at the pixel, or next to it where its depth is unknown."""
    assert frame.depth_m is not None
    x, y = pixel
    height, width = frame.depth_m.shape
    if not (0 <= x < width and 0 <= y < height):
        raise InvalidInputError(where, f"is {[x, y]}", f"a pixel of the image, {width} x {height}")
    top, left = max(round(y) - SEARCH_PX, 0), max(round(x) - SEARCH_PX, 0)
    rows, columns = np.nonzero(frame.depth_m[top : round(y) + SEARCH_PX + 1, left : round(x) + SEARCH_PX + 1])
    if not len(rows):
        raise InvalidInputError(where, f"is {[x, y]}, where {frame.camera.name} knows no depth", HELP)
    nearest = int(np.hypot(rows + top - y, columns + left - x).argmin())
    row, column = rows[nearest] + top, columns[nearest] + left
    (place_m,) = frame.camera.deproject([row], [column], [frame.depth_m[row, column]])
    return np.asarray(place_m)


def outlines(mask: Mask) -> list[list[tuple[float, float]]]:
    """Polygons (x, y) around each part of a mask (H, W), and around each hole."""
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    corners = [cv2.approxPolyDP(contour, OUTLINE_PX, closed=True).reshape(-1, 2) for contour in found]
    return [[(int(x), int(y)) for x, y in polygon] for polygon in corners if len(polygon) > 2]
