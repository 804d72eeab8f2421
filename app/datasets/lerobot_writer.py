"""Writes a LeRobot dataset, version 3.0, that the package `lerobot` loads.

Policies train on `observation.state` and `action` (the next frame's state); the other columns have the exact
trajectory. Objects, calibrated cameras and the first frame's images are in files beside them (`reader.SCENES`).
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets import lerobot as reader
from app.datasets.bounds import DatasetError, in_one_step
from app.datasets.parcel import Parcel, canonical_json
from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.types.trajectory import Trajectory

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}  # lerobot/datasets/compute_stats.py
RATE_TOLERANCE = 0.02  # of a measured rate; the column of times has the exact ones
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
Columns = dict[str, np.ndarray[Any, Any]]
_INDEX = "__index_level_0__"
_STATE = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "gripper_open"]
_NAMES = {
    "observation.state": _STATE,
    "action": _STATE,
    reader.POSITIONS: ["x_m", "y_m", "z_m"],
    reader.QUATERNIONS: ["qx", "qy", "qz", "qw"],
}


def write_lerobot(target: Path, parcels: Iterable[Parcel]) -> int:
    """Write the dataset and return the number of episodes.

    Raises:
        DatasetError: without episodes, for rates that differ or are not whole numbers, or if the folder exists.
    """
    with in_one_step(target) as root:
        trajectories, instructions, rates_hz = [], [], []
        for index, parcel in enumerate(parcels):
            _write_scene(root / reader.SCENES.format(index), parcel)
            trajectories.append(trajectory_from_npz(parcel.files["trajectory"]))
            instructions.append(str(parcel.metadata["instruction"]))
            rates_hz.append(float(parcel.metadata["control_frequency_hz"]))
        fps = _common_rate(rates_hz)
        tasks = list(dict.fromkeys(instructions))
        episodes = _numbered(trajectories, [tasks.index(text) for text in instructions], fps)
        _write_data(root / DATA_PATH.format(chunk_index=0, file_index=0), episodes)
        _write_tasks(root / "meta/tasks.parquet", tasks)
        _write_episodes(root / "meta/episodes/chunk-000/file-000.parquet", episodes, instructions)
        whole = {name: np.concatenate([columns[name] for columns in episodes]) for name in episodes[0]}
        documents = {"stats": _statistics(whole), "info": _info(episodes, tasks, fps)}
        for name, document in documents.items():
            (root / f"meta/{name}.json").write_text(json.dumps(document, indent=4))
    return len(trajectories)


def _write_scene(folder: Path, parcel: Parcel) -> None:
    folder.mkdir(parents=True)
    (folder / reader.METADATA).write_bytes(canonical_json(parcel.metadata))
    for name, data in parcel.files.items():
        if name != "trajectory":
            (folder / name).write_bytes(data)


def _common_rate(rates_hz: list[float]) -> int:
    if not rates_hz:
        raise DatasetError("there are no episodes to export")
    fps = round(rates_hz[0])
    if any(abs(rate - fps) > RATE_TOLERANCE * fps for rate in rates_hz):
        listed = ", ".join(f"{rate:g}" for rate in sorted(set(rates_hz)))
        raise DatasetError(f"LeRobot has one whole number of frames a second for a dataset; these have {listed}")
    return fps


def _numbered(trajectories: list[Trajectory], task_indices: list[int], fps: int) -> list[Columns]:
    """Return the columns of every episode that all episodes have."""
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
        reader.JOINT_VELOCITIES: trajectory.joint_velocities_rad_s if trajectory.num_joints else None,
        reader.JOINT_POSITIONS: trajectory.joint_positions_rad,
        reader.TIMES: trajectory.timestamps_s,
        reader.GRIPPER_WIDTH: trajectory.gripper_width_m,
        reader.WRENCHES: trajectory.wrenches_n_nm,
        reader.OBJECT_POSITIONS: _flat(trajectory.object_positions_m),
        reader.OBJECT_QUATERNIONS: _flat(trajectory.object_quaternions_xyzw),
    }
    return {
        "observation.state": state,
        "action": state[np.minimum(np.arange(num_frames) + 1, num_frames - 1)],
        reader.POSITIONS: trajectory.positions_m,
        reader.QUATERNIONS: trajectory.quaternions_xyzw,
        reader.GRIPPER: trajectory.gripper_open.astype(np.float32),
        **{name: array for name, array in optional.items() if array is not None},
    }


def _flat(tracks: np.ndarray[Any, Any] | None) -> np.ndarray[Any, Any] | None:
    return None if tracks is None else tracks.reshape(len(tracks), -1)


def _write_data(path: Path, episodes: Sequence[Columns]) -> None:
    """Write the frames of all episodes into one file, with a row group for each episode."""
    arrow, parquet = reader.arrow_and_parquet()

    def column(values: np.ndarray[Any, Any]) -> Any:  # noqa: ANN401
        flat = arrow.array(values.ravel())
        return flat if values.ndim == 1 else arrow.FixedSizeListArray.from_arrays(flat, values.shape[1])

    path.parent.mkdir(parents=True)
    tables = [arrow.table({name: column(values) for name, values in columns.items()}) for columns in episodes]
    with parquet.ParquetWriter(path, tables[0].schema) as writer:
        for table in tables:
            writer.write_table(table)


def _write_tasks(path: Path, tasks: Sequence[str]) -> None:
    """Write the instructions with their numbers; the instruction is the index of pandas' data frame."""
    arrow, parquet = reader.arrow_and_parquet()
    table = arrow.table({"task_index": np.arange(len(tasks)), _INDEX: list(tasks)})
    columns = (("task_index", "task_index", "int64", "int64"), (None, _INDEX, "unicode", "object"))
    names = ("name", "field_name", "pandas_type", "numpy_type")
    described = [{**dict(zip(names, column, strict=True)), "metadata": None} for column in columns]
    metadata = {"pandas": json.dumps({"index_columns": [_INDEX], "column_indexes": [], "columns": described})}
    parquet.write_table(table.replace_schema_metadata(metadata), path)


def _write_episodes(path: Path, episodes: Sequence[Columns], instructions: Sequence[str]) -> None:
    """Write the location of each episode's rows, and its statistics."""
    arrow, parquet = reader.arrow_and_parquet()
    path.parent.mkdir(parents=True)
    zeros = ("data/chunk_index", "data/file_index", "meta/episodes/chunk_index", "meta/episodes/file_index")
    rows = [
        {
            "episode_index": index,
            "tasks": [instruction],
            "length": len(columns["index"]),
            **dict.fromkeys(zeros, 0),
            "dataset_from_index": int(columns["index"][0]),
            "dataset_to_index": int(columns["index"][-1]) + 1,
            **{f"stats/{name}/{kind}": v for name, item in _statistics(columns).items() for kind, v in item.items()},
        }
        for index, (columns, instruction) in enumerate(zip(episodes, instructions, strict=True))
    ]
    parquet.write_table(arrow.Table.from_pylist(rows), path)


def _statistics(columns: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, dict[str, list[float]]]:
    """Return min, max, mean, std, count and quantiles of each column (T,) or (T, k), as lists of k numbers."""
    return {name: _statistics_of(column.reshape(len(column), -1)) for name, column in columns.items()}


def _statistics_of(column: np.ndarray[Any, Any]) -> dict[str, list[float]]:
    quantiles = np.quantile(column, list(QUANTILES.values()), axis=0)
    return {
        "min": column.min(axis=0).tolist(),
        "max": column.max(axis=0).tolist(),
        "mean": column.mean(axis=0, dtype=np.float64).tolist(),
        "std": column.std(axis=0, dtype=np.float64).tolist(),
        "count": [len(column)],
        **{name: row.tolist() for name, row in zip(QUANTILES, quantiles, strict=True)},
    }


def _info(episodes: list[Columns], tasks: list[str], fps: int) -> dict[str, Any]:
    features = {
        name: {"dtype": str(column.dtype), "shape": list(column.shape[1:]) or [1], "names": _NAMES.get(name)}
        for name, column in episodes[0].items()
    }
    return {
        "codebase_version": reader.VERSION,
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
