"""How far the way through a demonstration's actions leaves the recorded one: what the hand lifts, or goes around."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from app.pipeline.keyframes import Manner, Motion
from app.pipeline.keyframes.path import off_line_m
from roboprompt_client.trajectory import EndEffectorAction

LEFT_M = 0.03  # farther than this from the recorded path a hand may hit what the demonstration went around
OFTEN_SHARE = 1 / 3  # of a plan's recordings


def paths_left_m(motion: Motion, actions: Sequence[EndEffectorAction]) -> tuple[float, ...]:
    """The recorded positions' largest distance from straight motion to each action from the one before.

    Args:
        actions: at frames of the recording, ascending; the first is come to from the first frame.
    """
    found, before = [], 0
    positions_m = motion.trajectory.positions_m
    for action in actions:
        to_action_m = np.linalg.norm(positions_m[before:] - action.position_m, axis=1)
        frame = before + int(np.argmin(to_action_m))
        found.append(off_line_m(positions_m[before : frame + 1]))
        before = frame
    return tuple(found)


def path_left_m(motion: Motion, manner: Manner, actions: Sequence[EndEffectorAction]) -> float:
    """The largest distance that matters.

    An arm that rests at its keyframes may go from one to the next as it likes; but who chooses poses chooses one just
    before a grasp or a release, unless the way there is straight.

    Args:
        manner: how the recording moves.
    """
    left_m = paths_left_m(motion, actions)
    if manner != "rests":
        return max(left_m, default=0.0)
    states = [motion.phases[0].gripper_open, *(action.gripper_open for action in actions)]
    switches = [before != after for before, after in pairwise(states)]
    matters = [
        far_m for k, far_m in enumerate(left_m) if switches[k] and (switches[k - 1] if k > 0 else any(switches[1:]))
    ]
    return max(matters, default=0.0)


def leave_path(left_m: Sequence[float]) -> bool:
    """Whether more than a third of a plan's recordings are left by more than `LEFT_M`."""
    return sum(far_m > LEFT_M for far_m in left_m) > OFTEN_SHARE * len(left_m)
