"""Calibrated cameras and their images of one moment, checked when they are constructed.

`camera_to_world` takes OpenCV camera coordinates (x right, y down, z forward) to the world frame.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, bounded_array, positions_array, settle
from roboprompt_client.types.names import checked_name

ROTATION_MATRIX_TOLERANCE = 1e-3
MAX_PX = 1e6  # of a focal length or an optical center
MIN_FOCAL_PX = 0.1
MIN_DEPTH_SCALE_M, MAX_DEPTH_SCALE_M = 1e-7, 1.0  # per unit of a 16-bit image
MAX_AWAY_M = 50.0  # of a camera from the world's origin; in millimeters even a camera on a tripod is farther
OPTICAL_CENTRE_TOLERANCE = 0.25  # of the image's size: no lens is that far off-center, other image sizes are


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated pinhole camera. Pixel centers are whole numbers: u = column, v = row.

    Attributes:
        fx_px, fy_px, cx_px, cy_px: intrinsics; both focal lengths positive (OpenCV's convention).
        camera_to_world: (4, 4) rigid transform from OpenCV camera axes (x right, y down, z forward) to the world.
        depth_scale: meters per unit of a 16-bit depth image.
        image_size_px: (width, height) that the intrinsics were calibrated for, or None where unknown.
    """

    name: str
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    camera_to_world: Array
    depth_scale: float = 0.001
    image_size_px: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        where = f"cameras[{checked_name('cameras.name', self.name)}]"
        values = (self.fx_px, self.fy_px, self.cx_px, self.cy_px)
        fx, fy, _, _ = bounded_array(f"{where}.intrinsics", values, (4,), MAX_PX, "px")
        if min(fx, fy) < MIN_FOCAL_PX:
            remedy = "positive focal lengths: OpenCV axes, x right, y down, z forward (RLBench's are negative)"
            raise InvalidInputError(f"{where}.intrinsics", f"fx = {fx:g}, fy = {fy:g}", remedy)
        if not MIN_DEPTH_SCALE_M <= self.depth_scale <= MAX_DEPTH_SCALE_M:
            remedy = f"meters per unit of a depth image, {MIN_DEPTH_SCALE_M:g} to {MAX_DEPTH_SCALE_M:g}"
            raise InvalidInputError(f"{where}.depth_scale", f"is {self.depth_scale}", remedy)
        settle(self, camera_to_world=checked_camera_pose(f"{where}.camera_to_world", self.camera_to_world))

    def project(self, points_world_m: npt.ArrayLike) -> tuple[Array, Array]:
        """Where points of the world appear in the image.

        Args:
            points_world_m: (..., 3) meters in the world frame.

        Returns:
            pixels: (..., 2) as (u, v) = (column, row), not rounded; they may lie outside the image.
            depth_m: (...) meters along the optical axis. A point behind the camera has a depth <= 0 and its pixel means
                nothing (infinite or NaN at depth 0): the caller decides.
        """
        points = np.asarray(points_world_m, np.float64)
        in_camera = (points - self.camera_to_world[:3, 3]) @ self.camera_to_world[:3, :3]
        depth_m: Array = in_camera[..., 2]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            pixels = in_camera[..., :2] / depth_m[..., None] * (self.fx_px, self.fy_px) + (self.cx_px, self.cy_px)
        return pixels, depth_m

    def deproject(self, rows: npt.ArrayLike, columns: npt.ArrayLike, depth_m: npt.ArrayLike) -> Array:
        """World points (N, 3) in meters of pixels at rows, columns (N,), whole or not, and depths (N,)."""
        z = np.asarray(depth_m, np.float64)
        x = (np.asarray(columns) - self.cx_px) * z / self.fx_px
        y = (np.asarray(rows) - self.cy_px) * z / self.fy_px
        points: Array = np.stack([x, y, z], axis=1) @ self.camera_to_world[:3, :3].T + self.camera_to_world[:3, 3]
        return points


def checked_camera_pose(field: str, value: npt.ArrayLike) -> Array:
    """A camera's pose (4, 4), in meters.

    Raises:
        InvalidInputError: naming `field`, for anything else, and for a camera so far away that the unit is another.
    """
    transform = positions_array(field, value, (4, 4))
    if not _is_rigid(transform):
        remedy = "a rigid transform: rotation matrix, translation in meters, last row 0 0 0 1"
        raise InvalidInputError(field, "is not a rigid transform", remedy)
    if (away_m := float(np.linalg.norm(transform[:3, 3]))) > MAX_AWAY_M:
        message = f"puts the camera {away_m:.0f} m away: probably millimeters"
        raise InvalidInputError(field, message, f"meters, at most {MAX_AWAY_M:g}")
    return transform


def _is_rigid(transform: Array) -> bool:
    rotation = transform[:3, :3]
    if np.abs(rotation).max() > 1 + ROTATION_MATRIX_TOLERANCE:  # huge elements would make what follows infinite
        return False
    off = np.abs(rotation.T @ rotation - np.eye(3)).max()
    last_row = (transform[3] == (0, 0, 0, 1)).all()
    return bool(off <= ROTATION_MATRIX_TOLERANCE and np.linalg.det(rotation) > 0 and last_row)


def camera_json(camera: Camera) -> dict[str, Any]:
    """A camera's calibration."""
    intrinsics = {"fx": camera.fx_px, "fy": camera.fy_px, "cx": camera.cx_px, "cy": camera.cy_px}
    if camera.image_size_px is not None:
        intrinsics["width"], intrinsics["height"] = camera.image_size_px
    return {
        "name": camera.name,
        "intrinsics": intrinsics,
        "camera_to_world": camera.camera_to_world.tolist(),
        "depth_scale": camera.depth_scale,
    }


def camera_from_json(value: Mapping[str, Any]) -> Camera:
    """The inverse of `camera_json`.

    Raises:
        InvalidInputError: for a calibration that Camera refuses.
        KeyError, TypeError: for a document of another form.
    """
    k = value["intrinsics"]
    size = (k["width"], k["height"]) if k.get("width") is not None and k.get("height") is not None else None
    numbers = (k["fx"], k["fy"], k["cx"], k["cy"])
    transform = np.asarray(value["camera_to_world"], dtype=np.float64)
    return Camera(value["name"], *numbers, transform, value.get("depth_scale", 0.001), size)


@dataclass(frozen=True, eq=False)
class RgbdFrame:
    """One camera's images of the first frame.

    Attributes:
        rgb: (H, W, 3) uint8, or None.
        depth_m: (H, W) float32 meters along the optical axis, 0 where unknown, or None.
        mask: (H, W) int32 object ids, or None.
    """

    camera: Camera
    rgb: npt.NDArray[np.uint8] | None = None
    depth_m: npt.NDArray[np.float32] | None = None
    mask: npt.NDArray[np.int32] | None = None

    def __post_init__(self) -> None:
        name = self.camera.name
        images = {f"rgb_{name}": self.rgb, f"depth_{name}": self.depth_m, f"mask_{name}": self.mask}
        sizes = {part: image.shape[:2] for part, image in images.items() if image is not None}
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{part} {w}x{h}" for part, (h, w) in sizes.items())
            raise InvalidInputError(next(iter(sizes)), f"image sizes differ: {listed}", "one size per camera")
        for part, (height, width) in sizes.items():
            _check_image_size(self.camera, part, width, height)


def _check_image_size(camera: Camera, part: str, width: int, height: int) -> None:
    remedy = "images of the size that the intrinsics were calibrated for"
    if camera.image_size_px is not None:
        if camera.image_size_px != (width, height):
            expected = "{}x{}".format(*camera.image_size_px)
            raise InvalidInputError(part, f"is {width}x{height}, but the camera's images are {expected}", remedy)
        return
    off = max(abs(camera.cx_px / width - 0.5), abs(camera.cy_px / height - 0.5))
    if off > OPTICAL_CENTRE_TOLERANCE:
        center = f"({camera.cx_px:g}, {camera.cy_px:g})"
        message = f"is {width}x{height}, but the intrinsics put the optical center at {center}"
        raise InvalidInputError(part, message, f"{remedy}; for a cropped image give the camera's width and height")
