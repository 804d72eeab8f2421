"""Folders that RLBench's and PerAct's dataset generators write.

    TASK/all_variations/episodes/episodeN/   (PerAct)   or   TASK/variationN/episodes/episodeN/   (RLBench)
        low_dim_obs.pkl   variation_number.pkl   variation_descriptions.pkl (RLBench's stands beside `episodes`)
        front_rgb/0.png ...   front_depth/0.png ...   front_mask/0.png ...   and so on for other cameras

An episode's folder, or any folder above it, can be imported. Poses are in RLBench's world frame; frames come at 20 Hz.

Depth is a 24-bit fraction of the distance between near and far plane, red the highest byte; a mask's id is
R + 256 G + 65536 B (`rlbench/backend/utils.py`). Cameras have the axes x left, y up, z forward and negative focal
lengths; negating both axes gives OpenCV's convention and the same points.
"""

import os
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.datasets.bounds import Budget, DamagedError, read_inside
from app.datasets.options import ImportOptions, as_name
from app.datasets.parcel import Dataset, Entry, ObjectEntry, Parcel, depth_png, mask_png
from app.datasets.rlbench_pickle import Record, load_demo, load_descriptions, load_number
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, finite_array
from roboprompt_client.types.camera import Camera
from roboprompt_client.types.trajectory import Trajectory

LOW_DIM = "low_dim_obs.pkl"
DESCRIPTIONS = "variation_descriptions.pkl"
NUMBER = "variation_number.pkl"
CONTROL_FREQUENCY_HZ = 20.0  # RLBench's simulation step is 50 ms
HALF_OPEN = 0.5  # recorded as 0.0 or 1.0
POSE_SIZE = 7  # x y z, quaternion xyzw
DEPTH_SCALE = 2**24 - 1  # rlbench/backend/const.py
_KINDS = ("rgb", "depth", "mask")
_PNG = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
_PNG_HEAD = struct.Struct(f">{len(_PNG)}sII")  # signature, then width and height
_LARGEST_PIXEL_BYTES = 8
_EPISODE = re.compile(r"episode\d+")
_VARIATION = re.compile(r"variation(\d+)|all_variations")
_IMAGES = re.compile(r".*_(rgb|depth|mask)")
_NUMBERS = re.compile(r"(\d+)")


def looks_like(root: Path) -> bool:
    """Return whether the folder has episodes of this layout, at any depth."""
    return root.is_dir() and bool(_episode_folders(root))


def open_rlbench(root: Path, options: ImportOptions) -> Dataset:
    """Return every episode in or below the folder, in the order of their numbers."""
    root = root.resolve()
    entries = []
    for folder in _episode_folders(root):
        name = folder.name if folder == root else folder.relative_to(root).as_posix()
        entries.append(Entry(name, partial(_read, root, folder, name, options)))
    return Dataset("RLBench", tuple(entries))


def _episode_folders(root: Path) -> list[Path]:
    found = []
    for current, folders, files in os.walk(root):
        folders[:] = [name for name in folders if not _IMAGES.fullmatch(name)]
        folder = Path(current)
        if LOW_DIM in files or (folder.parent.name == "episodes" and _EPISODE.fullmatch(folder.name)):
            found.append(folder)
            folders.clear()
    return sorted(found, key=lambda path: [int(s) if s.isdigit() else s for s in _NUMBERS.split(str(path))])


def _read(root: Path, folder: Path, name: str, options: ImportOptions) -> Parcel:
    budget = Budget(folder, options.max_unpacked_bytes)
    observations = load_demo(root, folder / LOW_DIM, budget)
    misc: dict[str, Any] = observations[0].get("misc") or {}
    if not isinstance(misc, dict):
        raise DamagedError(folder / LOW_DIM, "has a misc that is no dictionary")
    variation = _variation(root, folder, misc, budget)
    instruction, others = _instructions(root, folder, options, budget)
    wanted = options.objects.of(name, variation)
    states = _object_states(folder / LOW_DIM, observations, wanted)
    cameras, images, notes = cameras_of(root, folder, misc, options, budget)
    if not wanted:
        message = f"the dataset names none; its masks show the ids {_listed(visible_ids(images))}"
        raise InvalidInputError("objects", message, "poses, mask ids or names with --objects FILE")
    return Parcel.of(
        task=options.task or as_name(_task(folder)),
        instruction=instruction,
        trajectory=_trajectory(folder / LOW_DIM, observations, states),
        control_frequency_hz=CONTROL_FREQUENCY_HZ,
        objects=wanted if states is None else tuple(map(_placed, wanted, states[0])),
        cameras=cameras,
        images=images,
        extra={"source": "RLBench", "variation": variation, "other_instructions": others},
        notes=notes,
    )


def _trajectory(path: Path, observations: list[Record], states: Array | None) -> Trajectory:
    poses = _stacked(path, observations, "gripper_pose")
    if poses.ndim != 2 or poses.shape[1] != 7:
        raise DamagedError(path, f"gripper_pose has shape {poses.shape}, expected (T, 7)")
    has_positions = all(item.get("joint_positions") is not None for item in observations)
    return Trajectory(
        joint_velocities_rad_s=_stacked(path, observations, "joint_velocities"),
        positions_m=poses[:, :3],
        quaternions_xyzw=poses[:, 3:],
        gripper_open=_stacked(path, observations, "gripper_open") > HALF_OPEN,
        joint_positions_rad=_stacked(path, observations, "joint_positions") if has_positions else None,
        object_positions_m=None if states is None else states[:, :, :3],
        object_quaternions_xyzw=None if states is None else states[:, :, 3:],
    )


def _object_states(path: Path, observations: list[Record], objects: Sequence[ObjectEntry]) -> Array | None:
    """Return the objects' poses (T, N, 7) if all are read from the task's state, else None."""
    offsets = [item.low_dim_state for item in objects]
    if not objects or None in offsets:
        return None
    state = _stacked(path, observations, "task_low_dim_state")
    found = [state[:, start : start + POSE_SIZE] for start in offsets if start is not None]
    for item, pose in zip(objects, found, strict=True):
        if pose.shape[1] != POSE_SIZE:
            reason = f"task_low_dim_state has {state.shape[1]} numbers: no pose of {item.name} at {item.low_dim_state}"
            raise DamagedError(path, reason)
    return np.stack(found, axis=1)


def _placed(item: ObjectEntry, pose: Array) -> ObjectEntry:
    return replace(item, position_m=tuple(pose[:3].tolist()), quaternion_xyzw=tuple(pose[3:].tolist()))


def _stacked(path: Path, observations: list[Record], name: str) -> Array:
    try:
        return np.stack([np.asarray(item.get(name), dtype=np.float64) for item in observations])
    except (TypeError, ValueError) as error:
        raise DamagedError(path, f"{name} is missing in a frame or differs in shape") from error


def _listed(ids: list[int]) -> str:
    return ", ".join(map(str, ids)) or "of nothing"


def _variation(root: Path, folder: Path, misc: dict[str, Any], budget: Budget) -> int | None:
    if (folder / NUMBER).exists():
        return load_number(root, folder / NUMBER, budget)
    if isinstance(number := misc.get("variation_index"), int):
        return number
    match = _VARIATION.fullmatch(folder.parent.parent.name)
    return int(match[1]) if match and match[1] else None


def _task(folder: Path) -> str:
    above = folder.parent.parent if folder.parent.name == "episodes" else folder.parent
    return above.parent.name if _VARIATION.fullmatch(above.name) else above.name


def _instructions(root: Path, folder: Path, options: ImportOptions, budget: Budget) -> tuple[str, list[str]]:
    if options.instruction is not None:
        return options.instruction, []
    above = folder.parent.parent  # not below the root if the episode is imported alone
    for within, path in ((root, folder / DESCRIPTIONS), (above, above / DESCRIPTIONS)):
        if path.exists():
            first, *others = load_descriptions(within, path, budget)
            return first, others
    raise DamagedError(folder / DESCRIPTIONS, "is missing: say what the robot does with --instruction")


def cameras_of(
    root: Path, folder: Path, misc: dict[str, Any], options: ImportOptions, budget: Budget
) -> tuple[tuple[Camera, ...], dict[str, bytes], tuple[str, ...]]:
    """Return an episode's calibrated cameras, their first images as PNG files by name of the part, and notes."""
    cameras, images = [], {}
    calibrated = calibrated_cameras(misc)
    for name in calibrated:
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
