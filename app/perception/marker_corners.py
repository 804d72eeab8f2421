"""The corners of markers to a tenth of a pixel.

OpenCV puts the corners of a small marker some 2 % inwards (all but its AprilTag refinement, which takes 90 ms): each
side is measured again across its black-to-white edge.
"""

import cv2
import numpy as np
import numpy.typing as npt

from app.pipeline.arrays import Array

ROUNDS = 2
SAMPLES = 16  # a side
END_SHARE = 0.12  # of a side, left out at both ends, where two edges blur into each other
PROFILE = 13  # samples across an edge
MAX_REACH_PX = 3.0  # to both sides of an edge
REACH_CELLS = 0.6  # the border is one cell wide: what lies beyond is another edge
FLAT = 1e-6  # grey values: keeps a side without any edge from dividing by zero


def sides_px(corners_px: Array) -> Array:
    """(M,) the length of each marker's shortest side."""
    sides: Array = np.linalg.norm(np.roll(corners_px, -1, axis=1) - corners_px, axis=2).min(axis=1)
    return sides


def refined_corners(grey: npt.NDArray[np.float32], corners_px: Array, cells: int) -> Array:
    """(M, 4, 2) corners as the intersections of the lines through their sides' edge points."""
    reach_px = np.minimum(MAX_REACH_PX, REACH_CELLS * sides_px(corners_px) / cells)
    for _ in range(ROUNDS):
        lines = _sides(grey, corners_px, reach_px)
        crossings = np.cross(np.roll(lines, 1, axis=1), lines)
        with np.errstate(divide="ignore", invalid="ignore"):  # parallel lines cross nowhere near
            refined = crossings[..., :2] / crossings[..., 2:]
        # where the edge is not near the detector's, e.g. under a finger, the detector's corner is the better one
        near = np.linalg.norm(refined - corners_px, axis=2) < 2 * reach_px[:, None]
        corners_px = np.where(near[..., None], refined, corners_px)
    return corners_px


def _sides(grey: npt.NDArray[np.float32], corners_px: Array, reach_px: Array) -> Array:
    """(M, 4, 3) homogeneous lines along which grey rises most steeply, from each corner to the next."""
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
    """The weighted least-squares lines (..., 3) through (..., N, 2) points."""
    shares = (weights / weights.sum(axis=-1, keepdims=True))[..., None]
    middle = (points * shares).sum(axis=-2)
    centred = points - middle[..., None, :]
    normal = np.linalg.eigh(np.swapaxes(centred * shares, -1, -2) @ centred)[1][..., 0]
    return np.concatenate([normal, -(normal * middle).sum(axis=-1, keepdims=True)], axis=-1)
