"""A camera's image with the poses and names of found objects drawn in."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from app.pipeline.geometry import rigid, transform_points
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import ObjectPose

RgbImage = npt.NDArray[np.uint8]
Color = tuple[int, int, int]
Box = tuple[int, int, int, int]  # x, y, width, height in pixels

# Okabe and Ito, "Color Universal Design" (2008): distinguishable by color-blind people
PALETTE: tuple[Color, ...] = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 158, 115),
    (240, 228, 66),
    (213, 94, 0),
    (204, 121, 167),
    (0, 114, 178),
)
NEAR_M = 0.02  # what is nearer to the camera's center, or behind it, is not drawn
FAR_PX = 100_000.0  # keeps lines to points far outside within OpenCV's integers
REFERENCE_HEIGHT_PX = 480  # lines and letters grow with taller images
AXIS_COLORS: tuple[Color, ...] = ((230, 30, 30), (30, 180, 30), (40, 80, 255))  # x, y, z
AXIS_M = 0.05
BLACK: Color = (0, 0, 0)


def draw_overlay(frame: RgbdFrame, poses: Sequence[ObjectPose]) -> RgbImage:
    """Return a copy of the frame's image (H, W, 3) with `poses` drawn in.

    A pose without rotation is a dot; an object outside of the view is named at the bottom.

    Raises:
        InvalidInputError: if the frame has no colors.
    """
    if frame.rgb is None:
        raise InvalidInputError(f"rgb_{frame.camera.name}", "is missing", "a camera with a color image")
    canvas = _Canvas(frame.camera, frame.rgb.copy())
    styled = [(pose, PALETTE[i % len(PALETTE)]) for i, pose in enumerate(poses)]
    for pose, color in styled:
        canvas.pose(pose, color)
    for pose, color in styled:
        canvas.name(pose.name if pose.confidence == 1 else f"{pose.name} {pose.confidence:.2f}", pose.position_m, color)
    return canvas.image


@dataclass(eq=False)
class _Canvas:
    """An image that takes points in the world; it is drawn into.

    Attributes:
        image: (H, W, 3).
        labels: those written.
    """

    camera: Camera
    image: RgbImage
    labels: list[Box] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._scale = max(self.image.shape[0] / REFERENCE_HEIGHT_PX, 0.5)
        self._thickness = max(round(self._scale), 1)

    def line(self, points_m: Array, color: Color) -> None:
        """A polyline through (N, 3) points, as far as it lies before the camera."""
        _, depths_m = self.camera.project(points_m)
        for (start, end), (start_depth, end_depth) in zip(pairwise(points_m), pairwise(depths_m), strict=True):
            if max(start_depth, end_depth) <= NEAR_M:
                continue
            cut = start
            if min(start_depth, end_depth) <= NEAR_M:
                cut = start + (NEAR_M - start_depth) / (end_depth - start_depth) * (end - start)
            first = self._pixel(cut if start_depth <= NEAR_M else start)
            second = self._pixel(cut if end_depth <= NEAR_M else end)
            cv2.line(self.image, first, second, color, 2 * self._thickness, cv2.LINE_AA)

    def dot(self, point_m: Array, color: Color) -> None:
        """A disc with a rim."""
        if self.camera.project(point_m)[1] > NEAR_M:
            radius_px = round(5 * self._scale)
            cv2.circle(self.image, self._pixel(point_m), radius_px, color, cv2.FILLED, cv2.LINE_AA)
            cv2.circle(self.image, self._pixel(point_m), radius_px, BLACK, 1, cv2.LINE_AA)

    def pose(self, pose: ObjectPose, color: Color) -> None:
        """The axes of an object, 5 cm long: x red, y green, z blue; a dot where it has no rotation."""
        if pose.quaternion_xyzw is None:
            self.dot(pose.position_m, color)
            return
        object_to_world = rigid(pose.position_m, pose.quaternion_xyzw)
        for axis, axis_color in zip(AXIS_M * np.eye(3), AXIS_COLORS, strict=True):
            self.line(transform_points(object_to_world, np.array([np.zeros(3), axis])), axis_color)

    def name(self, text: str, point_m: Array, color: Color) -> None:
        """A label beside a point, or at the bottom if the point is outside; clear of earlier labels."""
        height, width = self.image.shape[:2]
        column, row = self._pixel(point_m) if self.camera.project(point_m)[1] > NEAR_M else (-1, -1)
        if 0 <= column < width and 0 <= row < height:
            self._write(text, column + round(12 * self._scale), row - round(24 * self._scale), color)
        else:
            self._write(f"{text}: outside of this view", 0, height, color)

    def _write(self, text: str, x: int, y: int, color: Color) -> None:
        """White or black on `color`, moved into the image and up or down from other labels."""
        size, font = 0.45 * self._scale, cv2.FONT_HERSHEY_SIMPLEX
        (width, height), below = cv2.getTextSize(text, font, size, self._thickness)
        pad = self._thickness * 3
        box = (width + 2 * pad, height + below + 2 * pad)
        x, y = self._free_place(x, y, *box)
        self.labels.append((x, y, *box))
        cv2.rectangle(self.image, (x, y), (x + box[0] - 1, y + box[1] - 1), color, cv2.FILLED)
        ink = BLACK if np.dot(color, (0.299, 0.587, 0.114)) > 128 else (255, 255, 255)
        cv2.putText(self.image, text, (x + pad, y + pad + height), font, size, ink, self._thickness, cv2.LINE_AA)

    def _free_place(self, x: int, y: int, width: int, height: int) -> tuple[int, int]:
        x = int(np.clip(x, 0, max(self.image.shape[1] - width, 0)))
        lowest = max(self.image.shape[0] - height, 0)
        y = int(np.clip(y, 0, lowest))
        for place in sorted(range(lowest + 1), key=lambda row: abs(row - y)):
            if not any(_overlap((x, place, width, height), other) for other in self.labels):
                return x, place
        return x, y

    def _pixel(self, point_m: Array) -> tuple[int, int]:
        pixel, _ = self.camera.project(point_m)
        column, row = np.rint(np.clip(pixel, -FAR_PX, FAR_PX)).astype(int).tolist()
        return column, row


def _overlap(one: Box, other: Box) -> bool:
    (x, y, width, height), (left, top, wide, high) = one, other
    return x < left + wide and left < x + width and y < top + high and top < y + height
