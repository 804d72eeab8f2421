"""Markers in one camera: their corners to a tenth of a pixel, and points on their faces by depth.

OpenCV detects ArUco and AprilTag markers, but places the corners of a small marker some 2 % inwards (except with its
AprilTag refinement, which takes 90 ms). So each side is measured again across its black-to-white edge.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.markers.model import Marker
from roboprompt_client.cameras.board import marker_dictionary
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame

ROUNDS = 2
SAMPLES = 16  # a side
END_SHARE = 0.12  # omitted share of a side at both ends, where two edges blur into each other
PROFILE = 13  # samples across an edge
MAX_REACH_PX = 3.0  # to both sides of an edge
REACH_CELLS = 0.6  # the border is one cell wide: what lies beyond is another edge
FLAT = 1e-6  # grey values; avoids a division by 0 at a side without an edge
GreyImage = npt.NDArray[np.uint8]

# With these, 115 of 120 markers of 14 px (4 cm, 1.2 m away, seen from the side) are found in noisy renderings; with
# OpenCV's own settings 76, at twice the size 102.
PIXELS_PER_CELL = 12
CELL_MARGIN = 0.3
ENLARGED_WINDOWS_PX = (7, 23)  # windows of the adaptive threshold: the best two of OpenCV's three
MAX_ENLARGED_PIXELS = 1_000_000  # larger images are not enlarged
SIGMA_PX = 0.1  # of a corner: twice the value in noisy renderings, for errors of the lens model
SMALL_SIGMA_PX = 0.35  # for cells one pixel wide, inversely proportional to their width: neighboring edges blur
FACE_SHARE = 0.75  # of a face's side, around its middle: depth at its edge mixes with what lies behind
_CORNERS = np.array([[-0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.5, -0.5, 0.0], [-0.5, -0.5, 0.0]])


def _sides_px(corners_px: Array) -> Array:
    """Return the length (M,) of each marker's shortest side."""
    sides: Array = np.linalg.norm(np.roll(corners_px, -1, axis=1) - corners_px, axis=2).min(axis=1)
    return sides


def _refined_corners(grey: npt.NDArray[np.float32], corners_px: Array, cells: int) -> Array:
    """Return corners (M, 4, 2) as intersections of the lines through the sides' edge points."""
    reach_px = np.minimum(MAX_REACH_PX, REACH_CELLS * _sides_px(corners_px) / cells)
    for _ in range(ROUNDS):
        lines = _sides(grey, corners_px, reach_px)
        crossings = np.cross(np.roll(lines, 1, axis=1), lines)
        with np.errstate(divide="ignore", invalid="ignore"):  # parallel lines cross nowhere near
            refined = crossings[..., :2] / crossings[..., 2:]
        # keep the detector's corner if the edge is far from it, e.g. under a finger
        near = np.linalg.norm(refined - corners_px, axis=2) < 2 * reach_px[:, None]
        corners_px = np.where(near[..., None], refined, corners_px)
    return corners_px


def _sides(grey: npt.NDArray[np.float32], corners_px: Array, reach_px: Array) -> Array:
    """Return homogeneous lines (M, 4, 3) of the steepest rise of grey values, from each corner to the next."""
    along = np.roll(corners_px, -1, axis=1) - corners_px
    outward = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.linalg.norm(along, axis=2, keepdims=True)
    shares = np.linspace(END_SHARE, 1 - END_SHARE, SAMPLES)
    feet = corners_px[:, :, None] + shares[:, None] * along[:, :, None]  # (M, 4, SAMPLES, 2)
    offsets_px = np.linspace(-1, 1, PROFILE) * reach_px[:, None, None, None]
    places = feet[..., None, :] + offsets_px[..., None] * outward[:, :, None, None]
    columns, rows = np.moveaxis(places.astype(np.float32).reshape(-1, PROFILE, 2), -1, 0)
    profiles = cv2.remap(grey, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    rises = np.maximum(np.diff(profiles.reshape(places.shape[:-1]), axis=-1), 0)
    steepness = rises.sum(axis=-1) + FLAT
    middles_px = (offsets_px[..., 1:] + offsets_px[..., :-1]) / 2
    edges = feet + ((rises * middles_px).sum(axis=-1) / steepness)[..., None] * outward[:, :, None]
    return _lines(edges, steepness)


def _lines(points: Array, weights: Array) -> Array:
    """Return weighted least-squares lines (..., 3) through points (..., N, 2)."""
    shares = (weights / weights.sum(axis=-1, keepdims=True))[..., None]
    middle = (points * shares).sum(axis=-2)
    centered = points - middle[..., None, :]
    normal = np.linalg.eigh(np.swapaxes(centered * shares, -1, -2) @ centered)[1][..., 0]
    return np.concatenate([normal, -(normal * middle).sum(axis=-1, keepdims=True)], axis=-1)


class SeenMarker(NamedTuple):
    """A marker in an image.

    Attributes:
        corners_px: (4, 2) column and row of its black border's corners: top left, then clockwise as it was printed.
        corner_sigma_px: their standard deviation.
    """

    id: int
    corners_px: Array
    corner_sigma_px: float


def find_markers(rgb: npt.NDArray[np.uint8], dictionary: str, wanted: Collection[int]) -> tuple[SeenMarker, ...]:
    """Return the markers with `wanted` ids in an image (H, W, 3), each occurrence of an id.

    If some are missing, the image is searched again at twice its size, which takes 8 ms more at 640x480.
    """
    grey = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)
    found = [item for item in _detected(grey, dictionary) if item[0] in wanted]
    if not {id_ for id_, _ in found}.issuperset(wanted) and grey.size <= MAX_ENLARGED_PIXELS:
        larger = [item for item in _detected(grey, dictionary, enlarged=True) if item[0] in wanted]
        seen = {id_ for id_, _ in larger}
        found = larger + [item for item in found if item[0] not in seen]
    if not found:
        return ()
    ids, quads = zip(*found, strict=True)
    cells = marker_dictionary(dictionary).markerSize + 2
    corners_px = _refined_corners(grey.astype(np.float32), np.array(quads), cells)
    sigmas_px = np.maximum(SIGMA_PX, SMALL_SIGMA_PX * cells / _sides_px(corners_px))
    return tuple(map(SeenMarker, ids, corners_px, sigmas_px.tolist()))


def _detected(grey: GreyImage, dictionary: str, *, enlarged: bool = False) -> list[tuple[int, Array]]:
    """Return ids and corners (4, 2) by OpenCV, in the image or at twice its size."""
    options = cv2.aruco.DetectorParameters()
    options.perspectiveRemovePixelPerCell = PIXELS_PER_CELL
    options.perspectiveRemoveIgnoredMarginPerCell = CELL_MARGIN
    if enlarged:
        options.adaptiveThreshWinSizeMin, options.adaptiveThreshWinSizeMax = ENLARGED_WINDOWS_PX
        options.adaptiveThreshWinSizeStep = ENLARGED_WINDOWS_PX[1] - ENLARGED_WINDOWS_PX[0]
        grey = np.asarray(cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), np.uint8)
    quads, ids, _ = cv2.aruco.ArucoDetector(marker_dictionary(dictionary), options).detectMarkers(grey)
    if not quads:
        return []
    corners_px = np.array(quads, np.float64).reshape(-1, 4, 2)
    if enlarged:  # pixel centers are whole numbers in both images
        corners_px = (corners_px + 0.5) / 2 - 0.5
    return [(int(id_), quad) for id_, quad in zip(np.ravel(ids), corners_px, strict=True)]


@dataclass(frozen=True, eq=False)
class MarkerView:
    """A marker in a frame.

    Attributes:
        seen: in the image.
        points_m: (N, 3) of its face, in the camera's frame; those with known depth.
    """

    marker: Marker
    seen: SeenMarker
    points_m: Array

    @property
    def marker_to_object(self) -> Array:
        """(4, 4)."""
        return np.array(self.marker.marker_to_object)

    @property
    def corners_marker_m(self) -> Array:
        """(4, 3) in the marker's frame, in the order of the corners that are seen."""
        return self.marker.size_m * _CORNERS

    def starts(self, camera: Camera) -> list[Array]:
        """Return the one or two poses (4, 4), marker to camera, that explain corners and size."""
        matrix = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]])
        corners_m, corners_px, square = self.corners_marker_m, self.seen.corners_px, cv2.SOLVEPNP_IPPE_SQUARE
        _, turns, shifts_m, _ = cv2.solvePnPGeneric(corners_m, corners_px, matrix, None, flags=square)
        poses = np.tile(np.eye(4), (len(turns), 1, 1))
        for pose, turn, shift_m in zip(poses, turns, shifts_m, strict=True):
            pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], np.ravel(shift_m)
        return list(poses)


def face_points_m(frame: RgbdFrame, corners_px: Array) -> Array:
    """Return points (N, 3) of the face between corners (4, 2), in the camera's frame."""
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
