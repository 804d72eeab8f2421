"""From depth images to points: one camera's images without flying pixels, point clouds with normals.

Clouds have one point per voxel; their normals point towards the camera.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame

Index = npt.NDArray[np.intp]
Bools = npt.NDArray[np.bool_]

VOXEL_M = 0.004
MAX_VOXELS = 2**20  # along an axis, about 4 km
NORMAL_RADIUS_M, NORMAL_NEIGHBORS = 0.015, 14

WIDTH_PX = 800  # wider images are downsampled by an integer factor
FLYING_STEP_M = 0.02  # a larger step between neighbors makes a pixel unreliable
SLOPE = 5.0  # the same step in pixel widths, for small images: a slanting surface has less
FARTHEST_M = 5.0  # larger depths are clipped
NEAREST_RAD = 0.0035  # around a pixel for `nearest_m`, at least one pixel: errors of calibration
DepthImage = npt.NDArray[np.float32]
RgbImage = npt.NDArray[np.uint8]


class DepthSamples(NamedTuple):
    """A depth image, sampled where points project; all arrays have the points' shape (...).

    Attributes:
        depth_m: 0 where unknown or outside of the image.
        nearest_m: the least depth within `NEAREST_RAD` of the pixel, 0 if one there is unknown.
        point_m: the point's own depth along the optical axis.
        rows, columns: of the pixel, within the image.
    """

    depth_m: Array
    nearest_m: Array
    point_m: Array
    rows: Index
    columns: Index


@dataclass(frozen=True, eq=False)
class DepthView:
    """A depth image with its calibrated camera.

    Attributes:
        depth_m, nearest_m: (H, W), see `DepthSamples`.
        rgb: (H, W, 3) the mean of 3 x 3 pixels; empty (0, 0, 3) in a template's views.
        mask: (H, W) ids of objects, 0 for none; or None.
    """

    camera: Camera
    depth_m: DepthImage
    nearest_m: DepthImage
    rgb: RgbImage
    mask: npt.NDArray[np.int32] | None = None

    @classmethod
    def of(cls, frame: RgbdFrame) -> "DepthView":
        """Return the view of a frame with color and depth."""
        assert frame.rgb is not None
        assert frame.depth_m is not None
        step = -(-frame.depth_m.shape[1] // WIDTH_PX)
        intrinsics = {name: getattr(frame.camera, name) / step for name in ("fx_px", "fy_px", "cx_px", "cy_px")}
        camera = replace(frame.camera, **intrinsics, image_size_px=None)
        reduced_m = np.minimum(frame.depth_m[::step, ::step], np.float32(FARTHEST_M))
        depth_m = _without_flying(np.ascontiguousarray(reduced_m, np.float32), camera.fx_px)
        rgb = np.asarray(cv2.blur(frame.rgb, (max(3, step),) * 2)[::step, ::step], np.uint8)
        side_px = 2 * max(1, round(NEAREST_RAD * camera.fx_px)) + 1
        nearest_m = np.asarray(cv2.erode(depth_m, np.ones((side_px, side_px))), np.float32)
        mask = None if frame.mask is None else frame.mask[::step, ::step]
        return cls(camera, depth_m, nearest_m, np.ascontiguousarray(rgb), mask)

    @classmethod
    def of_depth(cls, camera: Camera, depth_m: DepthImage) -> "DepthView":
        """Return a view of unchanged depths, without colors."""
        return cls(camera, depth_m, depth_m, np.zeros((0, 0, 3), np.uint8))

    @property
    def eye_m(self) -> Array:
        """The camera's position (3,)."""
        return self.camera.camera_to_world[:3, 3]

    def look_up(self, points_m: Array) -> DepthSamples:
        """Return the image, sampled where points (..., 3) of its world frame project."""
        pixels, point_m = self.camera.project(points_m)
        height, width = self.depth_m.shape
        inside = (point_m > 0) & (pixels > -0.5).all(axis=-1) & (pixels < (width - 0.5, height - 0.5)).all(axis=-1)
        columns, rows = np.moveaxis(np.rint(np.where(inside[..., None], pixels, 0)).astype(np.intp), -1, 0)
        depth_m, nearest_m = self.depth_m[rows, columns], self.nearest_m[rows, columns]
        return DepthSamples(np.where(inside, depth_m, 0), np.where(inside, nearest_m, 0), point_m, rows, columns)


def free_views(
    views: Sequence[DepthView], template_to_world: Array, points_m: Array, margin_m: float
) -> Iterator[DepthView]:
    """Return depth images of the free space around a template's points (N, 3), cropped to these and a margin."""
    for view in views:
        camera_to_template = np.linalg.inv(template_to_world) @ view.camera.camera_to_world
        camera_to_template[3] = 0, 0, 0, 1
        camera = replace(view.camera, camera_to_world=camera_to_template)
        pixels, depth_m = camera.project(points_m)
        if (depth_m <= 0).any():
            continue
        margin_px = margin_m * max(camera.fx_px, camera.fy_px) / depth_m.min()
        height, width = view.depth_m.shape
        left, top = np.clip(np.floor(pixels.min(axis=0) - margin_px), 0, (width, height)).astype(int)
        right, bottom = np.clip(np.ceil(pixels.max(axis=0) + margin_px) + 1, 0, (width, height)).astype(int)
        if right - left >= 2 and bottom - top >= 2:
            cut = replace(camera, cx_px=camera.cx_px - left, cy_px=camera.cy_px - top)
            yield DepthView.of_depth(cut, view.nearest_m[top:bottom, left:right].copy())


def _without_flying(depth_m: DepthImage, focal_px: float) -> DepthImage:
    window = np.ones((3, 3))
    near, far = cv2.erode(depth_m, window), cv2.dilate(depth_m, window)
    step_m = np.maximum(np.float32(FLYING_STEP_M), near * np.float32(SLOPE / focal_px))
    return np.where((far - near > step_m) | (near == 0), np.float32(0), depth_m)


def thinned(points_m: Array, *others: Array) -> tuple[Array, ...]:
    """Return the mean point (N, 3) of each voxel, and the means (N, 3) of the points' other values (M, 3)."""
    cells = np.floor(points_m / VOXEL_M).astype(np.int64) + MAX_VOXELS // 2
    _, inverse, counts = np.unique(cells @ [1, MAX_VOXELS, MAX_VOXELS**2], return_inverse=True, return_counts=True)
    return tuple(
        np.stack([np.bincount(inverse, values[:, axis]) for axis in range(3)], axis=1) / counts[:, None]
        for values in (points_m, *others)
    )


def normals_of(points_m: Array, eyes_m: Array) -> Array:
    """Return unit normals (N, 3) of planes through each point's neighbors, towards the camera positions (N, 3)."""
    if len(points_m) < 3:
        return unit(eyes_m - points_m)
    count = min(NORMAL_NEIGHBORS, len(points_m))
    _, index = cKDTree(points_m).query(points_m, k=count, distance_upper_bound=NORMAL_RADIUS_M)
    known = (index < len(points_m))[..., None]
    near = points_m[np.minimum(index, len(points_m) - 1)]
    mean = np.where(known, near, 0).sum(axis=1, keepdims=True) / known.sum(axis=1, keepdims=True)
    offsets = np.where(known, near - mean, 0)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1][:, :, 0]
    facing = np.einsum("ni,ni->n", normals, eyes_m - points_m) < 0
    return np.where(facing[:, None], -normals, normals)


def lengths(vectors: Array) -> Array:
    """Return the lengths (...) of vectors (..., 3); several times as fast as `np.linalg.norm`."""
    result: Array = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return result


def unit(vectors: Array) -> Array:
    """Return vectors scaled to length 1; zero vectors remain zero."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    result: Array = vectors / np.maximum(lengths, 1e-12)
    return result
