"""A program's moves -> value maps of 100^3 voxels -> a way -> end-effector actions.

The way is the published planner's: greedy descent over the maps' cost, smoothed. The weights are those of its authors'
demo: the cost is twice the distance to the nearest target plus the blurred obstacles, each between 0 and 1.

A robot goes straight from action to action, so that a way is sent by its corners and by the points where the rotation
or the gripper changes. An action has no speed: programs may paint velocity maps, which nothing reads.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.signal import savgol_filter

from app.evaluation.failures import ProgramRefusedError
from app.evaluation.voxposer.sandbox import Scene
from app.evaluation.voxposer.voxels import SIZE
from roboprompt_client.types.arrays import Array, unit_quaternions
from roboprompt_client.types.poses import EndEffectorAction

MAX_ACTIONS = 100  # the way over value maps has more corners than a list of keyframes has rows
TARGET_WEIGHT, OBSTACLE_WEIGHT = 2.0, 1.0
BLUR_VOXELS = 10.0
REACH = 2  # voxels that one step may go along each axis
MAX_STEPS = 300
STOP_BELOW = 0.001  # a step must promise more than to go by this much upwards
VISITED = 1.0  # added to the cost of a voxel that was passed
SMOOTHED_OVER, SMOOTH_ORDER = 19, 3
CORNER_VOXELS = 1.0  # a way that strays by less from the straight line is one
SAME_TURN = 1e-6  # between quaternions, of numbers with 32 bits
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


def plan_moves(moves: Sequence[Mapping[str, Painted]], scene: Scene) -> tuple[EndEffectorAction, ...]:
    """The actions of all moves, one after the other.

    Raises:
        ProgramRefusedError: if a move has no target, or there are more than MAX_ACTIONS actions.
    """
    now, actions = scene.start, list[EndEffectorAction]()
    for number, move in enumerate(moves, start=1):
        maps = ValueMaps.painted(move, now.quaternion_xyzw, gripper_open=now.gripper_open)
        if not maps.targets.any():
            raise ProgramRefusedError(f"move {number} has no target: zeros were painted over its affordance map")
        way = plan_way(maps, np.array(scene.voxels.at(now.position_m.tolist())))
        actions += _corners(way, [_action_at(point, maps, scene) for point in way], now)
        now = actions[-1]
        if len(actions) > MAX_ACTIONS:
            raise ProgramRefusedError(f"the program takes more than max_actions = {MAX_ACTIONS} actions")
    return tuple(actions)


def _action_at(point: Array, maps: ValueMaps, scene: Scene) -> EndEffectorAction:
    """What the maps say at a point (3,) in voxels, not rounded."""
    x, y, z = np.clip(np.rint(point), 0, SIZE - 1).astype(int).tolist()
    turn = unit_quaternions("rotation map", maps.rotation[x, y, z].astype(float), (4,))
    position_m = np.array(scene.voxels.center_m(point.tolist()))
    return EndEffectorAction(position_m, turn, bool(maps.gripper[x, y, z] > 0.5))


def _corners(way: Array, actions: Sequence[EndEffectorAction], now: EndEffectorAction) -> list[EndEffectorAction]:
    """The actions that stand for a way (N, 3); one that switches the gripper at its start begins where the hand is."""
    if len(way) == 1:
        return [actions[0]]
    switched = actions[0].gripper_open != now.gripper_open
    first = [replace(now, gripper_open=actions[0].gripper_open)] if switched else []
    changes = [k for k in range(1, len(way)) if _differs(actions[k - 1], actions[k])]
    ends = sorted({0, *changes, len(way) - 1})
    kept = {k for low, high in pairwise(ends) for k in _strays(way, low, high)}
    return [*first, *(actions[k] for k in sorted({*kept, *ends} - {0}))]


def _differs(a: EndEffectorAction, b: EndEffectorAction) -> bool:
    turned = 1 - abs(float(a.quaternion_xyzw @ b.quaternion_xyzw)) > SAME_TURN
    return turned or a.gripper_open != b.gripper_open


def _strays(points: Array, low: int, high: int) -> list[int]:
    """The points between two that lie off the straight line, by Ramer, Douglas and Peucker."""
    if high - low < 2:
        return []
    along = points[high] - points[low]
    length = float(np.linalg.norm(along)) or 1.0
    offset = points[low + 1 : high] - points[low]
    across = offset - np.outer(offset @ along / length**2, along)
    distance = np.linalg.norm(across, axis=1)
    if distance.max() <= CORNER_VOXELS:
        return []
    worst = low + 1 + int(distance.argmax())
    return [*_strays(points, low, worst), worst, *_strays(points, worst, high)]


def cost_map(maps: ValueMaps) -> Array:
    """(100, 100, 100) what it costs to be in a voxel."""
    cost: Array = TARGET_WEIGHT * _normalized(distance_transform_edt(~maps.targets))
    if maps.avoidance.any():
        cost += OBSTACLE_WEIGHT * _normalized(gaussian_filter(maps.avoidance.astype(float), BLUR_VOXELS))
    return _normalized(cost)


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


def _normalized(values: Array) -> Array:
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
