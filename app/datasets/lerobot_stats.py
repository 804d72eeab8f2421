"""Statistics of columns as LeRobot keeps them, to normalise what a policy sees."""

from collections.abc import Mapping
from typing import Any

import numpy as np

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}  # lerobot/datasets/compute_stats.py


def statistics(columns: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, dict[str, list[float]]]:
    """Of each column (T,) or (T, k): a list of k numbers under min, max, mean, std, count and quantiles."""
    return {name: _of(column.reshape(len(column), -1)) for name, column in columns.items()}


def _of(column: np.ndarray[Any, Any]) -> dict[str, list[float]]:
    quantiles = np.quantile(column, list(QUANTILES.values()), axis=0)
    return {
        "min": column.min(axis=0).tolist(),
        "max": column.max(axis=0).tolist(),
        "mean": column.mean(axis=0, dtype=np.float64).tolist(),
        "std": column.std(axis=0, dtype=np.float64).tolist(),
        "count": [len(column)],
        **{name: row.tolist() for name, row in zip(QUANTILES, quantiles, strict=True)},
    }
