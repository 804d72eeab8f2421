"""A marker as one camera sees it: its corners in the image, and points of its face by depth."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from app.perception.markers.detection import SeenMarker
from app.perception.markers.model import Marker
from app.pipeline.arrays import Array
from app.pipeline.camera import Camera, RgbdFrame

FACE_SHARE = 0.75  # of a face's side, around its middle: depth at its edge mixes with what lies behind
_CORNERS = np.array([[-0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.5, -0.5, 0.0], [-0.5, -0.5, 0.0]])


@dataclass(frozen=True, eq=False)
class MarkerView:
    """A marker in a frame.

    Attributes:
        corners_px: (4, 2) column and row: top left, then clockwise.
        corner_sigma_px: their standard deviation.
        points_m: (N, 3) of its face, in the camera's frame; those with known depth.
    """

    marker: Marker
    corners_px: Array
    corner_sigma_px: float
    points_m: Array

    @classmethod
    def of(cls, frame: RgbdFrame, seen: SeenMarker, marker: Marker) -> Self:
        """With the depth on its face; `frame` has depth."""
        return cls(marker, seen.corners_px, seen.corner_sigma_px, _face_points(frame, seen.corners_px))

    @property
    def marker_to_object(self) -> Array:
        """(4, 4)."""
        return np.array(self.marker.marker_to_object)

    @property
    def corners_marker_m(self) -> Array:
        """(4, 3) in the marker's frame, in the order of `corners_px`."""
        return self.marker.size_m * _CORNERS

    def starts(self, camera: Camera) -> list[Array]:
        """The one or two poses (4, 4), marker to camera, that corners and size alone allow."""
        matrix = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]])
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            self.corners_marker_m, self.corners_px, matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        return [
            _transform(np.asarray(turn, float), np.asarray(shift, float))
            for turn, shift in zip(turns, shifts, strict=True)
        ]


def _transform(rotation_vector: Array, shift_m: Array) -> Array:
    transform = np.eye(4)
    transform[:3, :3] = cv2.Rodrigues(rotation_vector)[0]
    transform[:3, 3] = np.ravel(shift_m)
    return transform


def _face_points(frame: RgbdFrame, corners_px: Array) -> Array:
    assert frame.depth_m is not None
    middle = corners_px.mean(axis=0)
    inner = np.rint(middle + FACE_SHARE * (corners_px - middle)).astype(np.int32)
    x, y, width, height = cv2.boundingRect(inner)
    inside = np.zeros((height, width), np.uint8)
    cv2.fillConvexPoly(inside, inner - (x, y), 1)
    depth_m = frame.depth_m[y : y + height, x : x + width]
    rows, columns = np.nonzero((inside > 0) & (depth_m > 0))
    z = depth_m[rows, columns].astype(np.float64)
    camera = frame.camera
    return np.stack(
        [(columns + x - camera.cx_px) * z / camera.fx_px, (rows + y - camera.cy_px) * z / camera.fy_px, z], axis=1
    )
