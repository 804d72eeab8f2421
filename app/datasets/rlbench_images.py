"""Cameras and images in the folders that RLBench writes.

Depth is a 24-bit fraction of the distance between near and far plane, red the highest byte; a mask's id is
R + 256 G + 65536 B (`rlbench/backend/utils.py`). Cameras have the axes x left, y up, z forward and negative focal
lengths; negating both axes gives OpenCV's convention and the same points.
"""

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.datasets.bounds import Budget, DamagedError, read_inside
from app.datasets.options import ImportOptions
from app.datasets.parcel import depth_png, mask_png
from roboprompt_client.types.arrays import Array, finite_array
from roboprompt_client.types.camera import Camera

DEPTH_SCALE = 2**24 - 1  # rlbench/backend/const.py
_KINDS = ("rgb", "depth", "mask")
_PNG = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
_PNG_HEAD = struct.Struct(f">{len(_PNG)}sII")  # signature, then width and height
_LARGEST_PIXEL_BYTES = 8


def cameras_of(
    root: Path, folder: Path, misc: dict[str, Any], options: ImportOptions, budget: Budget
) -> tuple[tuple[Camera, ...], dict[str, bytes], tuple[str, ...]]:
    """Return an episode's calibrated cameras, their first images as PNG files by name of the part, and notes."""
    cameras, images = [], {}
    calibrated = calibrated_cameras(misc)
    for name in filter(options.wants, calibrated):
        if (read := read_images(root, folder, name, misc, budget)) is not None:
            cameras.append(read[0])
            images.update(read[1])
    if cameras:
        return tuple(cameras), images, ()
    reason = "no images of calibrated cameras" if calibrated else "no camera calibration in misc: images are left out"
    return (), {}, (reason,)


def camera_of(name: str, misc: Mapping[str, Any], size_px: tuple[int, int], depth_scale: float) -> Camera:
    """Return the camera in OpenCV's convention from an observation's `misc`; raises InvalidInputError."""
    matrix = finite_array(f"{name}_camera_intrinsics", misc[f"{name}_camera_intrinsics"], (3, 3))
    pose = finite_array(f"{name}_camera_extrinsics", misc[f"{name}_camera_extrinsics"], (None, 4))
    camera_to_world = np.eye(4)
    camera_to_world[:3] = pose[:3]  # older recordings leave out the last row
    for axis in (0, 1):
        if matrix[axis, axis] < 0:
            camera_to_world[:, axis] *= -1
    fx_px, fy_px, cx_px, cy_px = np.abs(matrix[[0, 1, 0, 1], [0, 1, 2, 2]]).tolist()
    return Camera(name, fx_px, fy_px, cx_px, cy_px, camera_to_world, depth_scale, size_px)


def calibrated_cameras(misc: Mapping[str, Any]) -> list[str]:
    """Return the names of the cameras with a calibration in `misc`."""
    end = "_camera_intrinsics"
    names = [key.removesuffix(end) for key in misc if isinstance(key, str) and key.endswith(end)]
    return sorted(name for name in names if f"{name}_camera_extrinsics" in misc)


def read_images(
    root: Path, folder: Path, name: str, misc: Mapping[str, Any], budget: Budget
) -> tuple[Camera, dict[str, bytes]] | None:
    """Return the camera and its images of the first frame in the folder below `root`; None without images.

    Raises:
        DamagedError: naming the file that cannot be decoded, or a missing plane of its depth.
    """
    paths = {kind: folder / f"{name}_{kind}" / "0.png" for kind in _KINDS}
    found = {kind: path for kind, path in paths.items() if path.exists()}
    if not found:
        return None
    images: dict[str, bytes] = {}
    sizes: list[tuple[int, int]] = []
    depth_scale = 0.001
    for kind, path in found.items():
        data = read_inside(root, path, budget)
        pixels = _decode(path, data, budget)
        sizes.append((pixels.shape[1], pixels.shape[0]))
        if kind == "depth":
            data, depth_scale = depth_png(depth_of(path, pixels, name, misc))
        elif kind == "mask":
            data = mask_png(ids_of(pixels))
        images[f"{kind}_{name}"] = data
    return camera_of(name, misc, sizes[0], depth_scale), images


def depth_of(path: Path, pixels: npt.NDArray[np.uint8], name: str, misc: Mapping[str, Any]) -> Array:
    """Return depth (H, W) in meters along the optical axis."""
    planes = [misc.get(f"{name}_camera_{plane}") for plane in ("near", "far")]
    if None in planes:
        raise DamagedError(path, f"needs {name}_camera_near and {name}_camera_far in the observation's misc")
    near_m, far_m = map(float, planes)  # type: ignore[arg-type]
    depth_m: Array = near_m + _number(pixels, (65536, 256, 1)) / DEPTH_SCALE * (far_m - near_m)
    return depth_m


def ids_of(pixels: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """Return object ids (H, W)."""
    return _number(pixels, (1, 256, 65536)) if pixels.ndim == 3 else pixels.astype(np.int64)


def visible_ids(images: Mapping[str, bytes]) -> list[int]:
    """Return the ids in the encoded masks of an episode."""
    masks = [data for part, data in images.items() if part.startswith("mask_")]
    shown = [np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)) for data in masks]
    return np.unique(np.concatenate([mask.ravel() for mask in shown])).tolist() if shown else []


def _number(pixels: npt.NDArray[np.uint8], weights: tuple[int, int, int]) -> npt.NDArray[np.int64]:
    numbers: npt.NDArray[np.int64] = pixels.astype(np.int64) @ np.array(weights)
    return numbers


def _decode(path: Path, data: bytes, budget: Budget) -> npt.NDArray[np.uint8]:
    is_png = data.startswith(_PNG) and len(data) >= _PNG_HEAD.size
    _, width_px, height_px = _PNG_HEAD.unpack_from(data) if is_png else (b"", 0, 0)
    budget.take(width_px * height_px * _LARGEST_PIXEL_BYTES, path)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if width_px and height_px else None
    if image is None or image.dtype != np.uint8:
        raise DamagedError(path, f"is damaged: {len(data)} bytes that are no 8-bit PNG")
    pixels = image.astype(np.uint8, copy=False)
    return pixels[..., 2::-1] if pixels.ndim == 3 else pixels
