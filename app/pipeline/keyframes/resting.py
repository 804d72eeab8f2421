"""Whether a recording rests at its keyframes, as scripted demonstrations do, or hesitates, as people do.

And how far the way through actions may leave the recorded one: what the hand lifts, or goes around.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from app.pipeline.keyframes.motion import Motion
from app.pipeline.keyframes.path import TOLERANCE_DEG, TOLERANCE_M, off_line_m
from app.pipeline.keyframes.rule import MAX_KEYFRAMES, SIMULATION_DELTA_RAD_S, merged
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

Manner = Literal["rests", "hesitates", "flows"]

NEARBY_S = 0.1  # a switch this near to a rest happens in it
MAX_RESTING = 0.5  # a recording that rests longer than it moves was made by a person who hesitates
ON_THE_WAY = 0.2  # the share of keyframes that may lie on a straight way; one always may
STRAIGHT = 1.5  # tolerances
MAX_BENT = 0.25  # the share of grasps and releases that may be come to otherwise
BENT = 0.15  # of its length: a way in joint space that bends more is no single motion
WIDE, WINDING = 3.0, 0.3  # in tolerances, and of its length in joint space: a way that bends more has a corner
LIFTED = 0.1  # the latter of a way on which something is carried: arms carry in lines, or at their joints' pace
MISSED_CORNERS = 0.5  # the share of corners that may be passed without a rest; one always may
CORNER_DEG = 60.0
ARM_M, STEP_M = 0.03, 0.005  # a corner is recognized by the ways of this length before and after it
MIN_ARM_M = 0.01
LEFT_M = 0.03  # farther than this from the recorded path a hand may hit what the demonstration went around
OFTEN_SHARE = 1 / 3  # of a plan's recordings


class _Way(NamedTuple):
    """The motion from one keyframe to the next.

    Attributes:
        to_switch: whether the gripper switches when it ends.
        from_grasp: whether the hand has closed where it begins.
    """

    first: int
    last: int
    to_switch: bool
    from_grasp: bool


def manner_of(motion: Motion, delta_rad_s: float = SIMULATION_DELTA_RAD_S) -> Manner:
    """How a recording moves.

    `rests`: the rests are its keyframes, so that `merged` finds these. Every grasp and release happens in a rest, the
    hand comes to it in a straight motion, corners are turned in rests, and (nearly) every rest is at a corner.
    `hesitates`: it rests on straight ways or longer than it moves, as people do, whose hand wavers as well.
    `flows`: anything else, and an arm whose joints were not recorded.
    """
    rests = motion.joint_speeds_rad_s < delta_rad_s
    if motion.trajectory.num_joints == 0 or not rests.any() or rests.all():
        return "flows"
    started = int(np.argmin(rests))
    switches_s = motion.times_s[[switch.frame for switch in motion.acting_switches]]
    ways = [
        _Way(first, last, bool((np.abs(motion.times_s[last] - switches_s) <= NEARBY_S).any()), _grasped(motion, first))
        for first, last in pairwise([0, *merged(motion, delta_rad_s)])
    ]
    on_the_way = sum(
        not before.to_switch and _bend(motion, before.first, after.last) <= 1 for before, after in pairwise(ways)
    )
    if float(rests[started:].mean()) > MAX_RESTING or on_the_way > max(1.0, ON_THE_WAY * len(ways)):
        return "hesitates"
    at_keyframes = (
        bool(rests[started:].any())
        and len(ways) <= MAX_KEYFRAMES
        and all(rests[np.abs(motion.times_s - switch_s) <= NEARBY_S].any() for switch_s in switches_s)
        # A person passes the pose above a thing without a rest, so that the way to the grasp has a corner.
        and sum(way.to_switch and _bends(motion, way, STRAIGHT, BENT) for way in ways) <= MAX_BENT * len(switches_s)
        and not any(_bends(motion, way, WIDE, LIFTED if way.from_grasp else WINDING) for way in ways)
        and _few_missed_corners(motion, rests)
    )
    return "rests" if at_keyframes else "flows"


def _grasped(motion: Motion, frame: int) -> bool:
    """Whether the hand closes where it is at a frame, staying there."""
    positions_m = motion.trajectory.positions_m
    stretches = [sorted((frame, switch.frame)) for switch in motion.acting_switches if not switch.opens]
    ways_m = [positions_m[first : last + 1] - positions_m[frame] for first, last in stretches]
    return any(float(np.linalg.norm(way_m, axis=1).max()) <= TOLERANCE_M for way_m in ways_m)


def _bends(motion: Motion, way: _Way, most: float, most_in_joints: float) -> bool:
    """Whether a way is several motions: bent in space and in the joints, which leave moving in proportion.

    So is one that turns what is held by half a turn or more.
    """
    path = motion.path(way.first, way.last, TOLERANCE_M, TOLERANCE_DEG)
    return path.turns_round or (path.bend > most and _bend_in_joints(motion, way) > most_in_joints)


def _bend(motion: Motion, first: int, last: int) -> float:
    """How far the hand leaves straight motion, in tolerances."""
    return motion.path(first, last, TOLERANCE_M, TOLERANCE_DEG).bend


def _bend_in_joints(motion: Motion, way: _Way) -> float:
    """How far the joints leave moving in proportion, as arms do on a free way, as a share of the length of the way."""
    moved = slice(way.first + 1, way.last + 1)
    steps_s = np.diff(motion.times_s[way.first : way.last + 1])[:, None]
    way_rad = np.cumsum(motion.trajectory.joint_velocities_rad_s[moved] * steps_s, axis=0)
    end_rad = way_rad[-1]
    length_rad = max(float(np.linalg.norm(end_rad)), 1e-9)
    along = np.outer(way_rad @ end_rad / length_rad**2, end_rad)
    return float(np.linalg.norm(way_rad - along, axis=1).max()) / length_rad


def _few_missed_corners(motion: Motion, rests: npt.NDArray[np.bool_]) -> bool:
    """Whether most corners of the path are turned at rest."""
    positions_m = motion.trajectory.positions_m
    way_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions_m, axis=0), axis=1))])
    corners_m = _corners_m(positions_m, way_m)
    rests_m = way_m[rests]
    missed = sum(bool(np.abs(rests_m - corner).min() > ARM_M) for corner in corners_m)
    return missed <= max(1.0, MISSED_CORNERS * len(corners_m))


def _corners_m(positions_m: Array, way_m: Array) -> list[float]:
    """Where the path turns sharply, by the length of way from the start."""
    steps_m = np.arange(0, way_m[-1], STEP_M)
    points_m = np.stack([np.interp(steps_m, way_m, axis) for axis in positions_m.T], axis=1)
    arm = round(ARM_M / STEP_M)
    if len(points_m) <= 2 * arm:
        return []
    middle = points_m[arm:-arm]
    before, after = middle - points_m[: -2 * arm], points_m[2 * arm :] - middle
    lengths = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    cosines = np.einsum("nk,nk->n", before, after) / np.maximum(lengths[0] * lengths[1], 1e-12)
    turns_deg = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    turns_deg[np.minimum(*lengths) < MIN_ARM_M] = 180.0  # the way folds back on itself
    corners: list[float] = []
    k = 0
    while k < len(turns_deg):
        if turns_deg[k] < CORNER_DEG:
            k += 1
            continue
        end = k + int(np.argmax(np.append(turns_deg[k:] < CORNER_DEG, True)))
        corners.append(float(steps_m[arm + k + int(np.argmax(turns_deg[k:end]))]))
        k = end + arm
    return corners


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
