"""One click on an object -> its mask in every camera.

The mask grows in depth over the table plane: everything that is connected above it. Where that becomes too large, since
things touch, it grows in color, too.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from app.perception.registered.candidates import parts_of
from app.perception.registered.cloud import VOXEL_M, Index
from app.perception.registered.scene import ABOVE_TABLE_M, Scene, to_lab
from app.pipeline.geometry import pixels_to_world
from roboprompt_client.arrays import Array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.errors import InvalidInputError

NEAR_CLICK_M = 0.015  # from the clicked pixel to a point above the table
SEARCH_PX = 4  # around the click for a pixel with depth
MAX_SPAN_M = 0.35  # of an object
ALIKE_LAB = 30.0  # from the clicked color
HELP = "another pixel of it; or a polygon around it"
Mask = npt.NDArray[np.bool_]


def masks_from_clicks(frames: Sequence[RgbdFrame], clicks: Mapping[str, tuple[float, float]]) -> dict[str, Mask]:
    """By camera the mask (H, W) of what was clicked on.

    Args:
        clicks: (x, y) pixels by camera, each on the object; one is enough.

    Raises:
        InvalidInputError: naming the camera, if a click is not on something above the table, or images are unusable.
    """
    scene = Scene.of(frames)
    by_name = {frame.camera.name: frame for frame in frames}
    clicked = [_clicked(scene, by_name[name], click) for name, click in clicks.items()]
    index = _grown(scene, np.unique(np.concatenate(clicked)), next(iter(clicks)))
    tree = cKDTree(scene.points_m[index])
    return {name: _mask(scene, tree, frame) for name, frame in by_name.items()}


def _clicked(scene: Scene, frame: RgbdFrame, click: tuple[float, float]) -> Index:
    """Index of the points next to the clicked one."""
    assert frame.depth_m is not None
    name, (x, y) = frame.camera.name, click
    height, width = frame.depth_m.shape
    if not (0 <= x < width and 0 <= y < height):
        raise InvalidInputError(f"clicks[{name}]", f"is {[x, y]}", f"a pixel of the image, {width} x {height}")
    top, left = max(round(y) - SEARCH_PX, 0), max(round(x) - SEARCH_PX, 0)
    rows, columns = np.nonzero(frame.depth_m[top : round(y) + SEARCH_PX + 1, left : round(x) + SEARCH_PX + 1])
    if not len(rows):
        raise InvalidInputError(f"clicks[{name}]", f"is {[x, y]}, where {name} knows no depth", HELP)
    rows, columns = rows + top, columns + left
    nearest = int(np.hypot(rows - y, columns - x).argmin())
    place_m = pixels_to_world(
        frame.camera, rows[[nearest]], columns[[nearest]], frame.depth_m[rows[[nearest]], columns[[nearest]]]
    )
    near = np.flatnonzero(np.linalg.norm(scene.points_m - place_m, axis=1) < NEAR_CLICK_M)
    if not len(near):
        above_cm = 100 * float(scene.table.height_m(place_m)[0])
        message = (
            f"is {[x, y]}, where {name} sees a point {above_cm:.1f} cm above the table: no object stands out there"
        )
        raise InvalidInputError(f"clicks[{name}]", message, HELP)
    return near


def _grown(scene: Scene, seeds: Index, camera: str) -> Index:
    """What is connected with the points `seeds`."""
    index = _connected(scene.points_m, np.arange(len(scene.points_m)), seeds)
    if _span_m(scene.points_m[index]) <= MAX_SPAN_M:
        return index
    lab = to_lab(scene.rgb)
    alike = np.linalg.norm(lab - np.median(lab[seeds], axis=0), axis=1) < ALIKE_LAB
    index = _connected(scene.points_m, np.flatnonzero(alike), seeds)
    span_m = _span_m(scene.points_m[index])
    if span_m > MAX_SPAN_M:
        message = f"grows to {100 * span_m:.0f} cm, at most {100 * MAX_SPAN_M:.0f}: it touches something alike"
        raise InvalidInputError(f"clicks[{camera}]", message, "a polygon around it")
    return index


def _connected(points_m: Array, among: Index, seeds: Index) -> Index:
    part = parts_of(points_m[among])
    return among[np.isin(part, part[np.isin(among, seeds)])]


def _span_m(points_m: Array) -> float:
    return float(np.ptp(points_m, axis=0).max()) if len(points_m) else np.inf


def _mask(scene: Scene, tree: cKDTree, frame: RgbdFrame) -> Mask:
    """The pixels of a camera whose points are the object's."""
    assert frame.depth_m is not None
    mask: Mask = np.zeros(frame.depth_m.shape, bool)
    pixels, depth_m = frame.camera.project(tree.data)
    before = depth_m > 0
    if not before.any():
        return mask
    left, top = np.clip(np.floor(pixels[before].min(axis=0)) - 3, 0, mask.shape[::-1]).astype(int)
    right, bottom = np.clip(np.ceil(pixels[before].max(axis=0)) + 4, 0, mask.shape[::-1]).astype(int)
    rows, columns = np.nonzero(frame.depth_m[top:bottom, left:right])
    rows, columns = rows + top, columns + left
    points_m = pixels_to_world(frame.camera, rows, columns, frame.depth_m[rows, columns])
    distance_m, _ = tree.query(points_m, distance_upper_bound=2 * VOXEL_M)
    own = np.isfinite(distance_m) & (scene.table.height_m(points_m) > ABOVE_TABLE_M[0])
    mask[rows[own], columns[own]] = True
    return mask
