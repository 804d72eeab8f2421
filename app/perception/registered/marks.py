"""What a person marks in pictures of an object, and which points of the scene that means."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import atan2, degrees

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.registered.cloud import Index
from app.perception.registered.scene import Scene
from app.pipeline.geometry import pixels_to_world
from roboprompt_client.arrays import Array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.errors import InvalidInputError

NEAR_CLICK_M = 0.015  # from the clicked pixel to a point above the table
SEARCH_PX = 4  # around the click for a pixel with depth
BOX_MARGIN_M = 0.006  # around a box: cameras are not calibrated exactly, and sides are seen edge-on
OUTLINE_PX = 0.8  # how far an outline may be off a mask
MIN_ARROW_M = 0.01
MAX_ARROW_M = 0.5  # a ray that hardly meets the arrow's height ends far away
HELP = "another pixel of it; or a box or a polygon around it"
Mask = npt.NDArray[np.bool_]
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


def clicked_points(
    scene: Scene, frames: Mapping[str, RgbdFrame], clicks: Mapping[str, Sequence[Pixel]], what: str
) -> list[Index]:
    """For each click the indices of the points next to it.

    Args:
        frames: by camera.
        what: the field that has the clicks.

    Raises:
        InvalidInputError: naming the camera, if nothing is there that stands above the table.
    """
    return [
        _near(scene, _point_m(frames[name], click, f"{what}[{name}]"), f"{what}[{name}]", click)
        for name, several in clicks.items()
        for click in several
    ]


def inside(scene: Scene, frame: RgbdFrame, box: Box) -> Mask:
    """(N,) which points lie behind the pixels of the box.

    Raises:
        InvalidInputError: naming the camera, if none does.
    """
    pixels, depth_m = frame.camera.project(scene.points_m)
    margin_px = (frame.camera.fx_px * BOX_MARGIN_M / np.where(depth_m > 0, depth_m, np.inf))[:, None]
    held = (pixels > np.subtract(box[:2], margin_px)) & (pixels < np.add(box[2:], margin_px))
    behind: Mask = (depth_m > 0) & held.all(axis=1)
    if not behind.any():
        message = f"is {list(box)}, where nothing stands on the table"
        raise InvalidInputError(f"boxes[{frame.camera.name}]", message, "[left, top, right, bottom] around the object")
    return behind


def in_the_middle(scene: Scene, frame: RgbdFrame, box: Box, among: Index) -> Index:
    """(1,) index of the point that is seen next to the middle of the box."""
    pixels, depth_m = frame.camera.project(scene.points_m[among])
    off_px = np.hypot(*(pixels - np.reshape(box, (2, 2)).mean(axis=0)).T)
    seen_there = np.flatnonzero(off_px <= off_px.min() + SEARCH_PX)
    return among[seen_there[[int(depth_m[seen_there].argmin())]]]


def yaw_of_arrow_deg(frame: RgbdFrame, tail: Pixel, head: Pixel) -> float:
    """Where a level arrow points about the vertical, from x to y, that is drawn from one pixel to another.

    Its tail is on the object, whose height it has.

    Raises:
        InvalidInputError: naming the camera, if the tail has no depth, or no such arrow is long enough to be sure.
    """
    where = f"arrows[{frame.camera.name}]"
    tail_m = _point_m(frame, tail, where)
    eye_m = frame.camera.camera_to_world[:3, 3]
    ray = _at(frame, head[1], head[0], 1.0) - eye_m
    reach = (tail_m[2] - eye_m[2]) / ray[2] if ray[2] else np.inf
    way_m = eye_m + reach * ray - tail_m
    if not (reach > 0 and MIN_ARROW_M <= np.hypot(*way_m[:2]) <= MAX_ARROW_M):
        remedy = f"an arrow of {100 * MIN_ARROW_M:.0f} to {100 * MAX_ARROW_M:.0f} cm in a camera that looks down"
        raise InvalidInputError(where, f"is {[*tail]} to {[*head]}, which is no such arrow on the table", remedy)
    return degrees(atan2(way_m[1], way_m[0]))


def outlines(mask: Mask) -> list[list[tuple[float, float]]]:
    """Polygons (x, y) around each part of a mask (H, W), and around each hole."""
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    corners = [cv2.approxPolyDP(contour, OUTLINE_PX, closed=True).reshape(-1, 2) for contour in found]
    return [[(int(x), int(y)) for x, y in polygon] for polygon in corners if len(polygon) > 2]


def _point_m(frame: RgbdFrame, pixel: Pixel, where: str) -> Array:
    """(3,) what the camera sees at the pixel, or next to it where its depth is unknown."""
    assert frame.depth_m is not None
    name, (x, y) = frame.camera.name, pixel
    height, width = frame.depth_m.shape
    if not (0 <= x < width and 0 <= y < height):
        raise InvalidInputError(where, f"is {[x, y]}", f"a pixel of the image, {width} x {height}")
    top, left = max(round(y) - SEARCH_PX, 0), max(round(x) - SEARCH_PX, 0)
    rows, columns = np.nonzero(frame.depth_m[top : round(y) + SEARCH_PX + 1, left : round(x) + SEARCH_PX + 1])
    if not len(rows):
        raise InvalidInputError(where, f"is {[x, y]}, where {name} knows no depth", HELP)
    nearest = int(np.hypot(rows + top - y, columns + left - x).argmin())
    row, column = rows[nearest] + top, columns[nearest] + left
    return _at(frame, row, column, frame.depth_m[row, column])


def _at(frame: RgbdFrame, row: float, column: float, depth_m: float) -> Array:
    """(3,) the point of the world at a pixel and depth."""
    (place_m,) = pixels_to_world(frame.camera, np.array([row]), np.array([column]), np.array([depth_m]))
    return np.asarray(place_m)


def _near(scene: Scene, place_m: Array, where: str, click: Pixel) -> Index:
    near = np.flatnonzero(np.linalg.norm(scene.points_m - place_m, axis=1) < NEAR_CLICK_M)
    if not len(near):
        above_cm = 100 * float(scene.table.height_m(place_m[None])[0])
        message = f"is {[*click]}, which shows a point {above_cm:.1f} cm above the table: no object stands out there"
        raise InvalidInputError(where, message, HELP)
    return near
