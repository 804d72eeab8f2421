"""The published planner: greedy descent over a cost map, smoothed; with the weights of its authors' demo.

The cost is twice the distance to the nearest target plus the blurred obstacles, each between 0 and 1.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.voxposer.maps import ValueMaps
from app.voxposer.program.voxels import SIZE
from roboprompt_client.arrays import Array

TARGET_WEIGHT, OBSTACLE_WEIGHT = 2.0, 1.0
BLUR_VOXELS = 10.0
REACH = 2  # voxels that one step may go along each axis
MAX_STEPS = 300
STOP_BELOW = 0.001  # a step must promise more than to go by this much upwards
VISITED = 1.0  # added to the cost of a voxel that was passed
SMOOTHED_OVER, SMOOTH_ORDER = 19, 3
Index = npt.NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Way:
    """A way through the voxels.

    Attributes:
        points: (N, 3) in voxels, not rounded; the first is the start, the last the middle of a target.
        reached: whether the descent ended at a target; where not, the last step goes there straight.
    """

    points: Array
    reached: bool


def cost_map(maps: ValueMaps) -> Array:
    """(100, 100, 100) what it costs to be in a voxel."""
    from scipy.ndimage import distance_transform_edt, gaussian_filter  # here for the reason in `_smoothed`

    cost: Array = TARGET_WEIGHT * _normalised(distance_transform_edt(~maps.targets))
    if maps.avoidance.any():
        cost += OBSTACLE_WEIGHT * _normalised(gaussian_filter(maps.avoidance.astype(float), BLUR_VOXELS))
    return _normalised(cost)


def plan_way(maps: ValueMaps, start: Index) -> Way:
    """Down the cost from voxel to voxel.

    Args:
        maps: with at least one target.
        start: (3,) voxel.
    """
    path = _descent(cost_map(maps), start)
    targets = maps.targets
    reached = bool(targets[tuple(path[-1])])
    nearest = path[-1] if reached else _nearest(targets, path[-1])
    smooth = _smoothed(path.astype(float))
    return Way(np.vstack([smooth[: -1 if reached else None], nearest]), reached)


def _normalised(values: Array) -> Array:
    low, high = values.min(), values.max()
    scaled: Array = (values - low) / (high - low) if high > low else np.zeros_like(values)
    return scaled


def _descent(cost: Array, start: Index) -> Index:
    """(N, 3) voxels, the start first; ends where no step leads further down."""
    walled = np.pad(cost, REACH, constant_values=np.inf)
    at, path = start.copy(), [start]
    for _ in range(MAX_STEPS):
        around = walled[tuple(slice(k, k + 2 * REACH + 1) for k in at)].copy()
        here = around[REACH, REACH, REACH]
        around[REACH, REACH, REACH] = np.inf
        if around.min() >= here + STOP_BELOW:
            break
        walled[tuple(at + REACH)] += VISITED
        at = at + np.array(np.unravel_index(around.argmin(), around.shape)) - REACH
        path.append(at)
    return np.array(path)


def _nearest(targets: npt.NDArray[np.bool_], at: Index) -> Index:
    found: Index = np.argwhere(targets)
    nearest: Index = found[np.linalg.norm(found - at, axis=1).argmin()]
    return nearest


def _smoothed(path: Array) -> Array:
    # A second of imports, which only those who ask for a program shall wait, not whoever starts the service.
    from scipy.signal import savgol_filter

    window = min(len(path), SMOOTHED_OVER)
    window -= window % 2 == 0
    if window <= SMOOTH_ORDER:
        return path
    smooth: Array = np.clip(savgol_filter(path, window, SMOOTH_ORDER, axis=0), 0, SIZE - 1)
    smooth[0] = path[0]
    return smooth
