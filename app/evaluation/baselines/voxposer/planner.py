"""Value maps of 100^3 voxels, and the published planner: greedy descent over their cost, smoothed.

The weights are those of its authors' demo: the cost is twice the distance to the nearest target plus the blurred
obstacles, each between 0 and 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.signal import savgol_filter

from app.evaluation.baselines.voxposer.program.voxels import SIZE
from roboprompt_client.arrays import Array

TARGET_WEIGHT, OBSTACLE_WEIGHT = 2.0, 1.0
BLUR_VOXELS = 10.0
REACH = 2  # voxels that one step may go along each axis
MAX_STEPS = 300
STOP_BELOW = 0.001  # a step must promise more than to go by this much upwards
VISITED = 1.0  # added to the cost of a voxel that was passed
SMOOTHED_OVER, SMOOTH_ORDER = 19, 3
Index = npt.NDArray[np.int_]
Values = npt.NDArray[np.float32]
Painted = Sequence[tuple[Any, Any]]


@dataclass(frozen=True, eq=False)
class ValueMaps:
    """Where one move is to go, and how.

    Attributes:
        affordance: (100, 100, 100) the higher, the rather the end effector is to be there.
        avoidance: (100, 100, 100) the higher, the less.
        rotation: (100, 100, 100, 4) quaternions xyzw in the world frame.
        gripper: (100, 100, 100) 1 open, 0 closed.
    """

    affordance: Values
    avoidance: Values
    rotation: Values
    gripper: Values

    @classmethod
    def painted(cls, move: Mapping[str, Painted], quaternion_xyzw: Array, *, gripper_open: bool) -> "ValueMaps":
        """The maps of a move.

        Args:
            move: for each kind that the program gave, boxes and values; later ones lie on top.
            quaternion_xyzw, gripper_open: those of the moment, which hold where a map says nothing.
        """
        empty: dict[str, Any] = {
            "affordance": 0.0,
            "avoidance": 0.0,
            "rotation": quaternion_xyzw,
            "gripper": float(gripper_open),
        }
        return cls(**{kind: _map(move.get(kind, ()), value) for kind, value in empty.items()})

    @property
    def targets(self) -> npt.NDArray[np.bool_]:
        """(100, 100, 100) the voxels of the highest affordance; none if it is 0 everywhere."""
        highest = float(self.affordance.max())
        found: npt.NDArray[np.bool_] = (self.affordance == highest) & (highest > 0)
        return found


def _map(painted: Painted, background: Any) -> Values:  # noqa: ANN401
    background = np.asarray(background, dtype=np.float32)
    values = np.broadcast_to(background, (SIZE, SIZE, SIZE, *background.shape))
    if not painted:
        return values
    values = values.copy()
    for ((x0, x1), (y0, y1), (z0, z1)), value in painted:
        values[x0:x1, y0:y1, z0:z1] = value
    return values


def cost_map(maps: ValueMaps) -> Array:
    """(100, 100, 100) what it costs to be in a voxel."""
    cost: Array = TARGET_WEIGHT * _normalised(distance_transform_edt(~maps.targets))
    if maps.avoidance.any():
        cost += OBSTACLE_WEIGHT * _normalised(gaussian_filter(maps.avoidance.astype(float), BLUR_VOXELS))
    return _normalised(cost)


def plan_way(maps: ValueMaps, start: Index) -> Array:
    """Down the cost from voxel to voxel; where the descent ends short of a target, the last step goes there straight.

    Args:
        maps: with at least one target.
        start: (3,) voxel.

    Returns:
        (N, 3) points in voxels, not rounded: first the start, last the middle of a target.
    """
    path = _descent(cost_map(maps), start)
    targets = maps.targets
    reached = bool(targets[tuple(path[-1])])
    nearest = path[-1] if reached else _nearest(targets, path[-1])
    smooth = _smoothed(path.astype(float))
    return np.vstack([smooth[: -1 if reached else None], nearest])


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
    window = min(len(path), SMOOTHED_OVER)
    window -= window % 2 == 0
    if window <= SMOOTH_ORDER:
        return path
    smooth: Array = np.clip(savgol_filter(path, window, SMOOTH_ORDER, axis=0), 0, SIZE - 1)
    smooth[0] = path[0]
    return smooth
