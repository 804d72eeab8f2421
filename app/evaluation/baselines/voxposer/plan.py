"""A program's moves -> waypoints with rotation and gripper -> end-effector actions.

A robot goes straight from action to action, so that a way is sent by its corners and by the points where the rotation
or the gripper changes. An action has no speed: programs may paint velocity maps, which nothing reads.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from app.evaluation.baselines.voxposer.planner import ValueMaps, plan_way
from app.evaluation.baselines.voxposer.program.voxels import SIZE
from app.evaluation.baselines.voxposer.sandbox import Scene, voxels_of
from app.evaluation.failures import ProgramRefusedError
from roboprompt_client.arrays import Array, unit_quaternions
from roboprompt_client.trajectory import EndEffectorAction

CORNER_VOXELS = 1.0  # a way that strays by less from the straight line is one
SAME_TURN = 1e-6  # between quaternions, of numbers with 32 bits


def plan_moves(moves: Sequence[dict[str, Any]], scene: Scene, max_actions: int) -> tuple[EndEffectorAction, ...]:
    """The actions of all moves, one after the other.

    Raises:
        ProgramRefusedError: if a move has no target, or there are more actions than `max_actions`.
    """
    now, actions = scene.start, list[EndEffectorAction]()
    for number, move in enumerate(moves, start=1):
        maps = ValueMaps.painted(move, now.quaternion_xyzw, gripper_open=now.gripper_open)
        if not maps.targets.any():
            raise ProgramRefusedError(f"move {number} has no target: zeros were painted over its affordance map")
        actions += _corners(_waypoints(maps, now, scene), now)
        now = actions[-1]
        if len(actions) > max_actions:
            raise ProgramRefusedError(f"the program takes more than max_actions = {max_actions} actions")
    return tuple(actions)


@dataclass(frozen=True, eq=False)
class Waypoint:
    """A point of a way, and what the maps say there.

    Attributes:
        voxel: (3,) not rounded.
    """

    voxel: Array
    action: EndEffectorAction


def _waypoints(maps: ValueMaps, now: EndEffectorAction, scene: Scene) -> list[Waypoint]:
    voxels = voxels_of(scene.workspace)
    way = plan_way(maps, np.array(voxels.at(now.position_m.tolist())))
    return [_waypoint(maps, point, voxels.centre_m(point.tolist())) for point in way]


def _waypoint(maps: ValueMaps, point: Array, position_m: Sequence[float]) -> Waypoint:
    x, y, z = np.clip(np.rint(point), 0, SIZE - 1).astype(int).tolist()
    turn = unit_quaternions("rotation map", maps.rotation[x, y, z].astype(float), (4,))
    return Waypoint(point, EndEffectorAction(np.array(position_m), turn, bool(maps.gripper[x, y, z] > 0.5)))


def _corners(way: Sequence[Waypoint], now: EndEffectorAction) -> list[EndEffectorAction]:
    """The actions that stand for a way; one that switches the gripper at its start begins where the hand is."""
    if len(way) == 1:
        return [way[0].action]
    switched = way[0].action.gripper_open != now.gripper_open
    first = [replace(now, gripper_open=way[0].action.gripper_open)] if switched else []
    changes = [k for k in range(1, len(way)) if _differs(way[k - 1].action, way[k].action)]
    ends = sorted({0, *changes, len(way) - 1})
    points = np.array([point.voxel for point in way])
    kept = {k for low, high in pairwise(ends) for k in _strays(points, low, high)}
    return [*first, *(way[k].action for k in sorted({*kept, *ends} - {0}))]


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
