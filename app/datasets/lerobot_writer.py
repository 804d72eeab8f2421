"""Episodes -> a LeRobot dataset, version 3.0, that the package `lerobot` loads.

`observation.state` and `action` (the next frame's state) are what policies train on; the other columns hold the
trajectory bit by bit. The first frame's images stand in meta/roboprompt: LeRobot knows only cameras that saw every
frame, and to repeat the first would pretend so.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets import lerobot
from app.datasets.errors import DatasetError
from app.datasets.lerobot_scenes import Scene, write_scene
from app.datasets.lerobot_stats import statistics
from app.datasets.lerobot_tables import write_data, write_episodes, write_tasks
from app.datasets.recording import Parcel
from app.datasets.writing import in_one_step
from app.pipeline.episode import Trajectory
from app.pipeline.trajectory_npz import trajectory_from_npz

Columns = dict[str, np.ndarray[Any, Any]]
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_STATE = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "gripper_open"]
_NAMES = {
    "observation.state": _STATE,
    "action": _STATE,
    lerobot.POSITIONS: ["x_m", "y_m", "z_m"],
    lerobot.QUATERNIONS: ["qx", "qy", "qz", "qw"],
}


def write_lerobot(target: Path, parcels: Iterable[Parcel]) -> int:
    """Write the dataset; returns the number of episodes.

    Raises:
        DatasetError: if there are no episodes, their rates differ or are no whole numbers, or the folder exists.
    """
    with in_one_step(target) as root:
        trajectories, instructions, rates_hz = [], [], []
        for index, parcel in enumerate(parcels):
            images = {part: data for part, data in parcel.files.items() if part != "trajectory"}
            write_scene(root, index, Scene(parcel.metadata, images))
            trajectories.append(trajectory_from_npz(parcel.files["trajectory"]))
            instructions.append(str(parcel.metadata["instruction"]))
            rates_hz.append(float(parcel.metadata["control_frequency_hz"]))
        fps = _common_rate(rates_hz)
        tasks = list(dict.fromkeys(instructions))
        episodes = _numbered(trajectories, [tasks.index(text) for text in instructions], fps)
        write_data(root / DATA_PATH.format(chunk_index=0, file_index=0), episodes)
        write_tasks(root / "meta/tasks.parquet", tasks)
        stats = [statistics(columns) for columns in episodes]
        write_episodes(root / "meta/episodes/chunk-000/file-000.parquet", episodes, instructions, stats)
        whole = {name: np.concatenate([columns[name] for columns in episodes]) for name in episodes[0]}
        _write_json(root / "meta/stats.json", statistics(whole))
        _write_json(root / "meta/info.json", _info(episodes, tasks, fps))
    return len(trajectories)


def _common_rate(rates_hz: list[float]) -> int:
    if not rates_hz:
        raise DatasetError("there are no episodes to export")
    if len(set(rates_hz)) > 1 or rates_hz[0] != round(rates_hz[0]):
        listed = ", ".join(f"{rate:g}" for rate in sorted(set(rates_hz)))
        raise DatasetError(f"LeRobot has one whole number of frames a second for a dataset; these have {listed}")
    return int(rates_hz[0])


def _numbered(trajectories: list[Trajectory], task_indices: list[int], fps: int) -> list[Columns]:
    """The columns of every episode; those that not all episodes have are left to none."""
    own = [_columns(trajectory) for trajectory in trajectories]
    shapes = [{name: column.shape[1:] for name, column in columns.items()} for columns in own]
    common = [name for name, shape in shapes[0].items() if all(item.get(name) == shape for item in shapes)]
    episodes, first = [], 0
    for index, (columns, task) in enumerate(zip(own, task_indices, strict=True)):
        frames = np.arange(len(columns["action"]))
        episodes.append(
            {
                **{name: columns[name] for name in common},
                "timestamp": (frames / fps).astype(np.float32),
                "frame_index": frames,
                "episode_index": np.full_like(frames, index),
                "index": first + frames,
                "task_index": np.full_like(frames, task),
            }
        )
        first += len(frames)
    return episodes


def _columns(trajectory: Trajectory) -> Columns:
    pose = [trajectory.positions_m, trajectory.quaternions_xyzw, trajectory.gripper_open[:, None]]
    state = np.concatenate(pose, axis=1).astype(np.float32)
    num_frames = len(trajectory)
    optional = {
        lerobot.JOINT_POSITIONS: trajectory.joint_positions_rad,
        lerobot.TIMES: trajectory.timestamps_s,
        lerobot.OBJECT_POSITIONS: _flat(trajectory.object_positions_m),
        lerobot.OBJECT_QUATERNIONS: _flat(trajectory.object_quaternions_xyzw),
    }
    return {
        "observation.state": state,
        "action": state[np.minimum(np.arange(num_frames) + 1, num_frames - 1)],
        lerobot.JOINT_VELOCITIES: trajectory.joint_velocities_rad_s,
        lerobot.POSITIONS: trajectory.positions_m,
        lerobot.QUATERNIONS: trajectory.quaternions_xyzw,
        lerobot.GRIPPER: trajectory.gripper_open.astype(np.float32),
        **{name: array for name, array in optional.items() if array is not None},
    }


def _flat(tracks: np.ndarray[Any, Any] | None) -> np.ndarray[Any, Any] | None:
    return None if tracks is None else tracks.reshape(len(tracks), -1)


def _info(episodes: list[Columns], tasks: list[str], fps: int) -> dict[str, Any]:
    features = {
        name: {"dtype": str(column.dtype), "shape": list(column.shape[1:]) or [1], "names": _NAMES.get(name)}
        for name, column in episodes[0].items()
    }
    return {
        "codebase_version": "v3.0",
        "robot_type": None,
        "total_episodes": len(episodes),
        "total_frames": sum(len(columns["index"]) for columns in episodes),
        "total_tasks": len(tasks),
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": DATA_PATH,
        "video_path": None,
        "features": features,
    }


def _write_json(path: Path, document: object) -> None:
    path.write_text(json.dumps(document, indent=4))
