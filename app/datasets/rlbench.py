"""Folders that RLBench's and PerAct's dataset generators write.

    TASK/all_variations/episodes/episodeN/   (PerAct)   or   TASK/variationN/episodes/episodeN/   (RLBench)
        low_dim_obs.pkl   variation_number.pkl   variation_descriptions.pkl (RLBench's stands beside `episodes`)
        front_rgb/0.png ...   front_depth/0.png ...   front_mask/0.png ...   and so on for other cameras

An episode's folder, or any folder above it, can be imported. Poses are in RLBench's world frame; frames come at 20 Hz.
"""

import os
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.bounds import Budget, DamagedError
from app.datasets.options import ImportOptions, as_name
from app.datasets.parcel import Dataset, Entry, ObjectEntry, Parcel
from app.datasets.rlbench_images import cameras_of, visible_ids
from app.datasets.rlbench_pickle import Record, load_demo, load_descriptions, load_number
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.trajectory import Trajectory

LOW_DIM = "low_dim_obs.pkl"
DESCRIPTIONS = "variation_descriptions.pkl"
NUMBER = "variation_number.pkl"
CONTROL_FREQUENCY_HZ = 20.0  # RLBench's simulation step is 50 ms
HALF_OPEN = 0.5  # recorded as 0.0 or 1.0
POSE_SIZE = 7  # x y z, quaternion xyzw
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
