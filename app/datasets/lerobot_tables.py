"""The parquet files of a LeRobot dataset, version 3.0."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.parquet import require_arrow

Columns = Mapping[str, np.ndarray[Any, Any]]
_INDEX = "__index_level_0__"


def write_data(path: Path, episodes: Sequence[Columns]) -> None:
    """The frames of all episodes in one file, a row group for each episode."""
    arrow, parquet = require_arrow()
    path.parent.mkdir(parents=True)
    tables = [arrow.table({name: _column(arrow, values) for name, values in columns.items()}) for columns in episodes]
    with parquet.ParquetWriter(path, tables[0].schema) as writer:
        for table in tables:
            writer.write_table(table)


def write_tasks(path: Path, tasks: Sequence[str]) -> None:
    """The instructions with their numbers; the instruction is the index of the frame that pandas makes of the file."""
    arrow, parquet = require_arrow()
    table = arrow.table({"task_index": np.arange(len(tasks)), _INDEX: list(tasks)})
    columns = (("task_index", "task_index", "int64", "int64"), (None, _INDEX, "unicode", "object"))
    described = [
        {
            "name": name,
            "field_name": field,
            "pandas_type": kind,
            "numpy_type": stored,
            "metadata": None,
        }
        for name, field, kind, stored in columns
    ]
    metadata = {"pandas": json.dumps({"index_columns": [_INDEX], "column_indexes": [], "columns": described})}
    parquet.write_table(table.replace_schema_metadata(metadata), path)


def write_episodes(
    path: Path, episodes: Sequence[Columns], instructions: Sequence[str], stats: Sequence[Mapping[str, Any]]
) -> None:
    """Where each episode's rows are, and its statistics."""
    arrow, parquet = require_arrow()
    path.parent.mkdir(parents=True)
    rows = []
    for index, (columns, instruction, of_columns) in enumerate(zip(episodes, instructions, stats, strict=True)):
        first = int(columns["index"][0])
        rows.append(
            {
                "episode_index": index,
                "tasks": [instruction],
                "length": len(columns["index"]),
                "data/chunk_index": 0,
                "data/file_index": 0,
                "dataset_from_index": first,
                "dataset_to_index": first + len(columns["index"]),
                **{f"stats/{name}/{kind}": v for name, item in of_columns.items() for kind, v in item.items()},
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
            }
        )
    parquet.write_table(arrow.Table.from_pylist(rows), path)


def _column(arrow: Any, values: np.ndarray[Any, Any]) -> Any:  # noqa: ANN401
    if values.ndim == 1:
        return arrow.array(values)
    return arrow.FixedSizeListArray.from_arrays(arrow.array(values.ravel()), values.shape[1])
