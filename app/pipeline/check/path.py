"""How far the way through a demonstration's keyframes leaves the way that was recorded."""

from collections.abc import Sequence

import numpy as np

from app.pipeline.arrays import Array
from app.pipeline.episode import EndEffectorAction, Trajectory
from app.pipeline.keyframes.path import off_line_m


def path_off_m(trajectory: Trajectory, actions: Sequence[EndEffectorAction]) -> float:
    """The recorded positions' largest distance from straight motion from the first frame through the actions.

    Args:
        actions: at frames of the trajectory, ascending.
    """
    farthest_m, before = 0.0, 0
    for action in actions:
        frame = before + _nearest(trajectory.positions_m[before:], action)
        farthest_m = max(farthest_m, off_line_m(trajectory.positions_m[before : frame + 1]))
        before = frame
    return farthest_m


def _nearest(positions_m: Array, action: EndEffectorAction) -> int:
    """The first frame at the action's place."""
    return int(np.argmin(np.linalg.norm(positions_m - action.position_m, axis=1)))
