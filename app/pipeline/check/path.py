"""How far the way through a demonstration's keyframes leaves the way that was recorded."""

from collections.abc import Sequence

import numpy as np

from app.pipeline.arrays import Array
from app.pipeline.episode import EndEffectorAction, Trajectory
from app.pipeline.keyframes.path import off_line_m


def paths_off_m(trajectory: Trajectory, actions: Sequence[EndEffectorAction]) -> tuple[float, ...]:
    """The recorded positions' largest distance from straight motion to each action from the one before.

    Args:
        actions: at frames of the trajectory, ascending; the first is come to from the first frame.
    """
    found, before = [], 0
    for action in actions:
        frame = before + _nearest(trajectory.positions_m[before:], action)
        found.append(off_line_m(trajectory.positions_m[before : frame + 1]))
        before = frame
    return tuple(found)


def _nearest(positions_m: Array, action: EndEffectorAction) -> int:
    """The first frame at the action's place."""
    return int(np.argmin(np.linalg.norm(positions_m - action.position_m, axis=1)))
