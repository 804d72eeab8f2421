"""Whether actions go where the recorded hand acts, and by its way: a keyframe rule may pass by a grasp or a lift."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from app.pipeline.findings.actions import distances_m
from app.pipeline.keyframes import Motion, manner_of
from app.pipeline.keyframes.resting import path_left_m
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import EndEffectorAction

NEVER_M = 1.0  # from a switch that no action makes


class Kept(NamedTuple):
    """How far actions are from a recording.

    Attributes:
        missed_m: from where the hand acts.
        left_m: the way through them, from the recorded one, where that matters.
    """

    missed_m: float
    left_m: float


def kept(motion: Motion, actions: Sequence[EndEffectorAction], delta_rad_s: float) -> Kept:
    """How closely at least one action keeps to a recording; an arm slower than `delta_rad_s` rests."""
    return Kept(missed_m(motion, actions), path_left_m(motion, manner_of(motion, delta_rad_s), actions))


def missed_m(motion: Motion, actions: Sequence[EndEffectorAction]) -> float:
    """How far the actions stay from the place where the recorded hand acts; of several places, the farthest.

    The hand acts where the gripper switches, at the nearest action with the gripper as it is then. Where it never does,
    the hand acts at the lowest place of its way, which the straight way from action to action may pass.

    Args:
        actions: at least one.
    """
    positions_m = motion.trajectory.positions_m
    if not motion.acting_switches:
        lowest_m = positions_m[int(positions_m[:, 2].argmin())]
        way_m = np.array([positions_m[0], *(action.position_m for action in actions)])
        return float(distances_m(way_m, lowest_m).min())
    return max(
        min(off_from_m(positions_m[frame], opens, a) for a in actions) for frame, opens in motion.acting_switches
    )


def off_from_m(place_m: Array, is_open: bool, action: EndEffectorAction) -> float:
    """How far an action is from a place; `NEVER_M` with the gripper otherwise."""
    return float(np.linalg.norm(action.position_m - place_m)) if action.gripper_open == is_open else NEVER_M
