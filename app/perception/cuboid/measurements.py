"""From pixels of an object to the input of a fit: surface points, outline rays, height of the ground."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.cuboid.segmentation import CROSS, Bools, Piece, eroded, inner, quantiles
from roboprompt_client.cameras.table import DEPTH_SIGMA_AT_1_M
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame

DEPTH_SIGMA_FLOOR_M = 0.001
INDEPENDENT_PIXELS = 12  # errors of neighboring depths correlate: so many pixels count as one measurement
MAX_POINTS, MAX_RAYS = 150, 120
MARGIN_PX = 16  # around the object, to see what it stands on
MIN_AROUND = 12  # pixels around the object that are needed to measure the ground
PROBE_PX = 3  # distance from the outline to the pixel that shows its surroundings
BEHIND_M = 0.015  # a pixel that is farther than the object by more is behind it
GROUND_STRIDE = 2  # use every so many rows and columns to measure the ground
GROUND_BIN_M = 0.004
GROUND_NEAR_M = 0.012
Pixels = npt.NDArray[np.intp]
NEIGHBORS: Pixels = np.array([(0, 1), (0, -1), (1, 0), (-1, 0)])


@dataclass(frozen=True, eq=False)
class Measurements:
    """One camera's measurements of an object, to which a shape is fitted.

    Attributes:
        points_m: (N, 3) of its surface in the world frame.
        point_sigma_m: standard deviation of a point's depth, with the correlation of neighbors included.
        eye_m: (3,) the camera's place.
        rays: (M, 3) unit vectors in the world frame from the eye along the object's outline.
        footprint_m: width of a pixel at the object's distance.
        ground_m: height of the surface around it, or None.
    """

    points_m: Array
    point_sigma_m: float
    eye_m: Array
    rays: Array
    footprint_m: float
    ground_m: float | None


def measure_piece(frame: RgbdFrame, piece: Piece) -> Measurements:
    """Return the camera's measurements of the piece."""
    assert frame.depth_m is not None
    camera = frame.camera
    corner = np.maximum((piece.top_px - MARGIN_PX, piece.left_px - MARGIN_PX), 0)
    bottom, right = np.add((piece.top_px, piece.left_px), piece.mask.shape) + MARGIN_PX
    depth_m = frame.depth_m[corner[0] : bottom, corner[1] : right]
    mask = piece.mask_in(int(corner[1]), int(corner[0]), depth_m.shape)

    def points_m(pixels: Pixels) -> Array:
        rows, columns = pixels.T
        return camera.deproject(rows + corner[0], columns + corner[1], depth_m[rows, columns])

    surface = np.argwhere(inner(mask) & (depth_m > 0))
    stride = max(1, round(len(surface) / MAX_POINTS))
    surface_m = points_m(surface[::stride])
    around = GROUND_STRIDE * np.argwhere((~mask & (depth_m > 0))[::GROUND_STRIDE, ::GROUND_STRIDE])
    ground_m = _ground_m(points_m(around)[:, 2], surface_m[:, 2])
    rim, outward = _rim(mask)
    probe = np.clip(rim + PROBE_PX * outward, 0, np.array(mask.shape) - 1)
    rim_depth_m, probe_depth_m = depth_m[tuple(rim.T)], depth_m[tuple(probe.T)]
    behind = probe_depth_m > np.where(rim_depth_m > 0, rim_depth_m, piece.distance_m) + BEHIND_M
    if ground_m is not None:
        behind |= np.abs(points_m(probe)[:, 2] - ground_m) < GROUND_NEAR_M
    # edges towards an occluder, or to something on top of it, are not its outline
    edges = (rim + outward / 2)[behind & ~mask[tuple(probe.T)]]
    sigma_m = float(np.hypot(DEPTH_SIGMA_AT_1_M * piece.distance_m**2, DEPTH_SIGMA_FLOOR_M))
    return Measurements(
        surface_m,
        sigma_m * max(1.0, np.sqrt(INDEPENDENT_PIXELS / stride)),
        camera.camera_to_world[:3, 3],
        _rays(camera, edges + corner)[:: max(1, round(len(edges) / MAX_RAYS))],
        piece.distance_m / camera.fx_px,
        ground_m,
    )


def _ground_m(around_m: Array, object_m: Array) -> float | None:
    """Return the most frequent height around the object, or None if there is no clear one."""
    below = around_m[around_m < quantiles(object_m, 0.5) + GROUND_NEAR_M]
    if len(below) < MIN_AROUND:
        return None
    counts = np.bincount(((below - below.min()) / GROUND_BIN_M).astype(int))
    peak = below.min() + (np.argmax(counts) + 0.5) * GROUND_BIN_M
    near = below[np.abs(below - peak) < GROUND_NEAR_M]
    return float(quantiles(near, 0.5)[0]) if len(near) > 0.2 * len(below) else None


def _rim(mask: Bools) -> tuple[Pixels, Pixels]:
    """Return pixels (M, 2) of the mask that have a neighbor outside of it, and the step (M, 2) to that neighbor."""
    rim = np.argwhere(mask & ~eroded(mask, CROSS))
    beside = rim + NEIGHBORS[:, None]
    framed = cv2.copyMakeBorder(mask.view(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    direction, pixel = np.nonzero(framed[beside[..., 0] + 1, beside[..., 1] + 1] == 0)
    return rim[pixel], NEIGHBORS[direction]


def _rays(camera: Camera, pixels: Array) -> Array:
    """(M, 3) unit vectors in the world frame through (row, column) pixels."""
    rows, columns = pixels[:, 0], pixels[:, 1]
    ends_m = camera.deproject(rows, columns, np.ones(len(pixels)))
    offsets = ends_m - camera.camera_to_world[:3, 3]
    rays: Array = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    return rays
