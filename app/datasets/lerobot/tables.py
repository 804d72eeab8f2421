"""Reads tables from the Parquet files of strangers, within a budget: a few bytes may stand for any number of rows."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.bounds import Budget, DamagedError, MissingPackageError

ROWS_AT_ONCE = 4096
FEW_ROWS = 16  # of images
MAX_DESCRIPTION_BYTES = 100_000_000  # of a file's schema and row groups, and as many of these
_LARGEST_NUMBER_BYTES = 8


def read_table(path: Path, columns: Sequence[str] | None, budget: Budget) -> Any:  # noqa: ANN401
    """Return columns of a file (None: all) as a pyarrow Table; raises DamagedError, also beyond the budget."""
    with _opened(path) as file:
        schema = file.schema_arrow
        names = schema.names if columns is None else list(columns)
        if absent := set(names) - set(schema.names):
            raise DamagedError(path, f"has no column {sorted(absent)[0]}")
        fields = [schema.field(name) for name in names]
        _check(path, file.metadata, set(names), budget)
        batches = []
        for batch in file.iter_batches(ROWS_AT_ONCE, columns=names):
            budget.take(batch.nbytes, path)
            batches.append(batch)
        arrow, _ = require_arrow()
        return arrow.Table.from_batches(batches, schema=arrow.schema(fields)).select(names)


def read_value(path: Path, column: str, row: int, budget: Budget) -> Any:  # noqa: ANN401
    """Return the value of one row, reading few others; raises DamagedError, also for a row that does not exist."""
    with _opened(path) as file:
        for group in range(file.num_row_groups):
            num_rows = file.metadata.row_group(group).num_rows
            if row < num_rows:
                for batch in file.iter_batches(FEW_ROWS, row_groups=[group], columns=[column]):
                    if row < batch.num_rows:
                        budget.take(batch.slice(row, 1).nbytes, path)
                        return batch.column(0)[row].as_py()
                    row -= batch.num_rows
            row -= num_rows
    raise DamagedError(path, f"has no such row of {column}")


def column_names(path: Path) -> list[str]:
    """Return the names of a file's columns; raises DamagedError."""
    with _opened(path) as file:
        return list(file.schema_arrow.names)


def numbers_of(table: Any, name: str) -> np.ndarray[Any, Any]:  # noqa: ANN401
    """Return the column as (T,) or (T, k) numbers in the stored precision."""
    arrow, _ = require_arrow()
    column = table.column(name).combine_chunks()
    if not arrow.types.is_nested(column.type):
        values: np.ndarray[Any, Any] = column.to_numpy(zero_copy_only=False)
        return values
    flat = column.flatten()
    if arrow.types.is_nested(flat.type):
        return np.asarray(column.to_pylist())
    numbers: np.ndarray[Any, Any] = flat.to_numpy(zero_copy_only=False).reshape(len(column), -1)
    return numbers


def require_arrow() -> tuple[Any, Any]:
    """Return the modules pyarrow and pyarrow.parquet; raises MissingPackageError."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise MissingPackageError("LeRobot datasets", "pyarrow") from error
    return pyarrow, parquet


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    arrow, parquet = require_arrow()
    if path.exists() and not path.is_file():
        raise DamagedError(path, "is not a regular file")
    limits = {"thrift_string_size_limit": MAX_DESCRIPTION_BYTES, "thrift_container_size_limit": MAX_DESCRIPTION_BYTES}
    try:
        with parquet.ParquetFile(path, **limits) as file:
            yield file
    except (OSError, arrow.ArrowException) as error:
        raise DamagedError(path, f"cannot be read: {str(error)[:200]}") from error


def _check(path: Path, metadata: Any, names: set[str], budget: Budget) -> None:  # noqa: ANN401
    """Refuse a file that is too large by its own metadata."""
    num_bytes = 0
    for group in map(metadata.row_group, range(metadata.num_row_groups)):
        if group.num_rows < 0:
            raise DamagedError(path, f"has a row group of {group.num_rows} rows")
        for column in map(group.column, range(group.num_columns)):
            if _is_of(column.path_in_schema, names):
                num_bytes += max(column.num_values * _LARGEST_NUMBER_BYTES, column.total_uncompressed_size)
    if num_bytes > budget.left_bytes:
        budget.take(num_bytes, path)


def _is_of(path: str, names: set[str]) -> bool:
    """Return whether a leaf such as ``observation.images.element`` belongs to one of the columns."""
    return path in names or any(path.startswith(f"{name}.") for name in names)
