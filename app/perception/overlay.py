"""A camera's image with what was found in it drawn over: masks, outlines, axes and names.

What is known of an object's shape becomes lines in the object's frame; the canvas takes lines, discs and names at
points of the world.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.base import ObjectQuery
from app.perception.cuboid.model import CuboidModel
from app.perception.cuboid.pieces import color_mask, to_hsv
from app.perception.markers.model import Marker, MarkersModel
from app.perception.object_model import ObjectModel
from app.pipeline.geometry import rigid, transform_points
from roboprompt_client.arrays import Array
from roboprompt_client.camera import Camera, RgbdFrame
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import ObjectPose

RgbImage = npt.NDArray[np.uint8]
Color = tuple[int, int, int]
Box = tuple[int, int, int, int]  # x, y, width, height in pixels

MASK_SHARE = 0.35
NEAR_M = 0.02  # what is nearer to the camera's centre, or behind it, is not drawn
FAR_PX = 100_000.0  # keeps lines to points far outside within OpenCV's integers
REFERENCE_HEIGHT_PX = 480  # lines and letters grow with taller images
CIRCLE_POINTS = 24
CYLINDER_SIDES = 4
_SQUARE = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0], [-0.5, 0.5, 0]])
# Okabe and Ito, "Color Universal Design" (2008): the colour-blind distinguish them, too
PALETTE: tuple[Color, ...] = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 158, 115),
    (240, 228, 66),
    (213, 94, 0),
    (204, 121, 167),
    (0, 114, 178),
)
AXIS_COLORS: tuple[Color, ...] = ((230, 30, 30), (30, 180, 30), (40, 80, 255))
AXIS_M = 0.05


@dataclass(eq=False)
class Canvas:
    """An image that takes points in the world.

    Attributes:
        labels: (x, y, width, height) of those written.
        outside: how many labels stand at the bottom.
    """

    camera: Camera
    image: RgbImage
    labels: list[Box] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._scale = max(self.image.shape[0] / REFERENCE_HEIGHT_PX, 0.5)
        self._thickness = max(round(self._scale), 1)

    def tint(self, mask: npt.NDArray[np.bool_], color: Color) -> None:
        """Colour pixels lightly and draw their outline."""
        tinted = (1 - MASK_SHARE) * self.image[mask] + MASK_SHARE * np.array(color)
        self.image[mask] = tinted.astype(np.uint8)
        contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(self.image, contours, -1, color, self._thickness)

    def line(self, points_m: Array, color: Color, *, bold: bool = False) -> None:
        """A polyline through (N, 3) points, as far as it lies before the camera."""
        seen = self._to_camera(points_m)
        for start, end in pairwise(seen):
            if (clipped := _before_camera(start, end)) is not None:
                first, second = (self._pixel(point) for point in clipped)
                thickness = self._thickness * (2 if bold else 1)
                cv2.line(self.image, first, second, color, thickness, cv2.LINE_AA)

    def dot(self, point_m: Array, color: Color) -> None:
        """A disc with a rim."""
        (seen,) = self._to_camera(point_m[None])
        if seen[2] > NEAR_M:
            radius_px = round(5 * self._scale)
            cv2.circle(self.image, self._pixel(seen), radius_px, color, cv2.FILLED, cv2.LINE_AA)
            cv2.circle(self.image, self._pixel(seen), radius_px, (0, 0, 0), 1, cv2.LINE_AA)

    def name(self, text: str, point_m: Array, color: Color) -> None:
        """A label beside a point, clear of earlier labels; at the bottom if the point is not in the image."""
        (seen,) = self._to_camera(point_m[None])
        height, width = self.image.shape[:2]
        column, row = self._pixel(seen) if seen[2] > NEAR_M else (-1, -1)
        if 0 <= column < width and 0 <= row < height:
            self._write(text, column + round(12 * self._scale), row - round(24 * self._scale), color)
        else:
            self._write(f"{text}: outside of this view", 0, height, color)

    def _write(self, text: str, x: int, y: int, color: Color) -> None:
        """White or black on the object's colour, moved into the image and up or down from other labels."""
        size, font = 0.45 * self._scale, cv2.FONT_HERSHEY_SIMPLEX
        (width, height), below = cv2.getTextSize(text, font, size, self._thickness)
        pad = self._thickness * 3
        box = (width + 2 * pad, height + below + 2 * pad)
        x, y = self._free_place(x, y, *box)
        self.labels.append((x, y, *box))
        cv2.rectangle(self.image, (x, y), (x + box[0] - 1, y + box[1] - 1), color, cv2.FILLED)
        ink = (0, 0, 0) if np.dot(color, (0.299, 0.587, 0.114)) > 128 else (255, 255, 255)
        cv2.putText(self.image, text, (x + pad, y + pad + height), font, size, ink, self._thickness, cv2.LINE_AA)

    def _free_place(self, x: int, y: int, width: int, height: int) -> tuple[int, int]:
        x = int(np.clip(x, 0, max(self.image.shape[1] - width, 0)))
        lowest = max(self.image.shape[0] - height, 0)
        y = int(np.clip(y, 0, lowest))
        for place in sorted(range(lowest + 1), key=lambda row: abs(row - y)):
            if not any(_overlap((x, place, width, height), other) for other in self.labels):
                return x, place
        return x, y

    def _to_camera(self, points_m: Array) -> Array:
        rotation, eye = self.camera.camera_to_world[:3, :3], self.camera.camera_to_world[:3, 3]
        seen: Array = (points_m - eye) @ rotation
        return seen

    def _pixel(self, seen_m: Array) -> tuple[int, int]:
        camera, (x, y, z) = self.camera, seen_m
        pixel = np.array([camera.fx_px * x / z + camera.cx_px, camera.fy_px * y / z + camera.cy_px])
        column, row = np.rint(np.clip(pixel, -FAR_PX, FAR_PX)).astype(int).tolist()
        return column, row


def _before_camera(start: Array, end: Array) -> tuple[Array, Array] | None:
    """The part of a segment, in the camera's frame, that lies beyond NEAR_M."""
    if max(start[2], end[2]) <= NEAR_M:
        return None
    if min(start[2], end[2]) > NEAR_M:
        return start, end
    cut = start + (NEAR_M - start[2]) / (end[2] - start[2]) * (end - start)
    return (cut, end) if start[2] <= NEAR_M else (start, cut)


def _overlap(one: Box, other: Box) -> bool:
    (x, y, width, height), (left, top, wide, high) = one, other
    return x < left + wide and left < x + width and y < top + high and top < y + height


def outlines(model: ObjectModel | None) -> list[Array]:
    """Polylines, each (N, 3) in metres; none for a model that knows no shape."""
    if isinstance(model, CuboidModel):
        lines = _cylinder() if model.shape == "cylinder" else _box()
        return [line * model.size_m - model.origin_m for line in lines]
    if isinstance(model, MarkersModel):
        return [_marker(marker) for marker in model.markers]
    return []


def _box() -> list[Array]:
    """The 12 edges of a cube of side 1."""
    corners = np.array(list(product((-0.5, 0.5), repeat=3)))
    return [np.array([a, b]) for i, a in enumerate(corners) for b in corners[i + 1 :] if (a != b).sum() == 1]


def _cylinder() -> list[Array]:
    """The rims and some sides of a cylinder of diameter and height 1."""
    turns = np.linspace(0, 2 * np.pi, CIRCLE_POINTS + 1)
    rim = np.stack([np.cos(turns), np.sin(turns), np.ones_like(turns)], axis=1) / 2
    low = rim * (1, 1, -1)
    sides = [np.array([low[i], rim[i]]) for i in range(0, CIRCLE_POINTS, CIRCLE_POINTS // CYLINDER_SIDES)]
    return [rim, low, *sides]


def _marker(marker: Marker) -> Array:
    return transform_points(np.array(marker.marker_to_object), marker.size_m * _SQUARE)


def draw_overlay(frame: RgbdFrame, poses: Sequence[ObjectPose], queries: Sequence[ObjectQuery] = ()) -> RgbImage:
    """A copy of the frame's colours, (H, W, 3), with `poses` drawn in.

    A pose without rotation is a dot; an object outside of the view is only named, at the bottom.

    Args:
        queries: what was known of the objects, for their masks and outlines; by name.

    Raises:
        InvalidInputError: if the frame has no colours.
    """
    if frame.rgb is None:
        raise InvalidInputError(f"rgb_{frame.camera.name}", "is missing", "a camera with a colour image")
    canvas = Canvas(frame.camera, frame.rgb.copy())
    known = {query.name: query for query in queries}
    styled = [(pose, known.get(pose.name), PALETTE[i % len(PALETTE)]) for i, pose in enumerate(poses)]
    for _, query, color in styled:
        if query is not None and (mask := _mask(frame, query)) is not None:
            canvas.tint(mask, color)
    for pose, query, color in styled:
        _draw_shape(canvas, pose, query, color)
    for pose, _, color in styled:
        canvas.name(_label(pose), pose.position_m, color)
    return canvas.image


def _mask(frame: RgbdFrame, query: ObjectQuery) -> npt.NDArray[np.bool_] | None:
    """The pixels that count as the object's, where the query tells."""
    if query.mask_ids and frame.mask is not None:
        return np.isin(frame.mask, query.mask_ids)
    if isinstance(query.model, CuboidModel) and frame.rgb is not None:
        return np.asarray(color_mask(to_hsv(frame.rgb), query.model.color), np.bool_)
    return None


def _draw_shape(canvas: Canvas, pose: ObjectPose, query: ObjectQuery | None, color: Color) -> None:
    if pose.quaternion_xyzw is None:
        canvas.dot(pose.position_m, color)
        return
    object_to_world = rigid(pose.position_m, pose.quaternion_xyzw)
    for line in outlines(None if query is None else query.model):
        canvas.line(transform_points(object_to_world, line), color)
    for axis, axis_color in zip(AXIS_M * np.eye(3), AXIS_COLORS, strict=True):
        canvas.line(transform_points(object_to_world, np.array([np.zeros(3), axis])), axis_color, bold=True)


def _label(pose: ObjectPose) -> str:
    return pose.name if pose.confidence == 1 else f"{pose.name} {pose.confidence:.2f}"
