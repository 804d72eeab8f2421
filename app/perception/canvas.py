"""A camera's image that takes lines, discs and names at points of the world."""

from dataclasses import dataclass, field
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from app.pipeline.arrays import Array
from app.pipeline.camera import Camera

RgbImage = npt.NDArray[np.uint8]
Color = tuple[int, int, int]
Box = tuple[int, int, int, int]  # x, y, width, height in pixels

MASK_SHARE = 0.35
NEAR_M = 0.02  # what is nearer to the camera's centre, or behind it, is not drawn
FAR_PX = 100_000.0  # keeps lines to points far outside within OpenCV's integers
REFERENCE_HEIGHT_PX = 480  # lines and letters grow with taller images


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
