"""Whether a recording rests at its keyframes, as scripts do, hesitates, as people do, or flows.

Also measures how far straight motion between actions leaves the recorded path, which may lift over or avoid things.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.pipeline.keyframes.motion import Manner, Motion
from app.pipeline.keyframes.path import TOLERANCE_DEG, TOLERANCE_M, off_line_m
from app.pipeline.keyframes.rules import MAX_KEYFRAMES, SIMULATION_DELTA_RAD_S, merged
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

NEARBY_S = 0.1  # a switch this near to a rest happens in it
MAX_RESTING = 0.5  # a person hesitates in a recording with a larger share of rests
ON_THE_WAY = 0.2  # share of keyframes that may lie on straight motion; one always may
STRAIGHT = 1.5  # tolerances
MAX_BENT = 0.25  # share of grasps and releases whose approach may not be straight
BENT = 0.15  # of its length: a motion in joint space with a larger deviation is no single motion
WIDE, WINDING = 3.0, 0.3  # in tolerances, and of the length in joint space: beyond both a motion has a corner
LIFTED = 0.1  # the same as WINDING while something is carried
MISSED_CORNERS = 0.5  # share of corners that may be passed without a rest; one always may
CORNER_DEG = 60.0
ARM_M, STEP_M = 0.03, 0.005  # path length before and after a corner by which it is recognized; its resolution
MIN_ARM_M = 0.01
LEFT_M = 0.03  # farther from the recorded path the hand may hit what the demonstration avoided
OFTEN_SHARE = 1 / 3  # of a plan's recordings


class _Leg(NamedTuple):
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
    """Return how a recording moves.

    `rests`: its rests are its keyframes, which `merged` finds. Every grasp and release happens in a rest after straight
    motion, corners are at rests, and (nearly) every rest is at a corner.
    `hesitates`: it rests within straight motion, or longer than it moves, as people do.
    `flows`: anything else, and recordings without joints.
    """
    if delta_rad_s not in motion.manners:
        motion.manners[delta_rad_s] = _manner_of(motion, delta_rad_s)
    return motion.manners[delta_rad_s]


def _manner_of(motion: Motion, delta_rad_s: float) -> Manner:
    rests = motion.joint_speeds_rad_s < delta_rad_s
    if motion.trajectory.num_joints == 0 or not rests.any() or rests.all():
        return "flows"
    started = int(np.argmin(rests))
    switches_s = motion.times_s[[switch.frame for switch in motion.acting_switches]]
    legs = [
        _Leg(first, last, bool((np.abs(motion.times_s[last] - switches_s) <= NEARBY_S).any()), _grasped(motion, first))
        for first, last in pairwise([0, *merged(motion, delta_rad_s)])
    ]
    if float(rests[started:].mean()) > MAX_RESTING:
        return "hesitates"
    on_the_way = sum(
        not before.to_switch and motion.path(before.first, after.last, TOLERANCE_M, TOLERANCE_DEG).bend <= 1
        for before, after in pairwise(legs)
    )
    if on_the_way > max(1.0, ON_THE_WAY * len(legs)):
        return "hesitates"
    at_keyframes = (
        bool(rests[started:].any())
        and len(legs) <= MAX_KEYFRAMES
        and all(rests[np.abs(motion.times_s - switch_s) <= NEARBY_S].any() for switch_s in switches_s)
        # A person passes the pose above a thing without a rest, so that the way to the grasp has a corner.
        and sum(leg.to_switch and _bends(motion, leg, STRAIGHT, BENT) for leg in legs) <= MAX_BENT * len(switches_s)
        and not any(_bends(motion, leg, WIDE, LIFTED if leg.from_grasp else WINDING) for leg in legs)
        and not any(leg.from_grasp and _lifts(motion, leg) for leg in legs)
        and _few_missed_corners(motion, rests)
    )
    return "rests" if at_keyframes else "flows"


def _grasped(motion: Motion, frame: int) -> bool:
    """Return whether the hand closes at its position of a frame, without leaving it."""
    positions_m = motion.trajectory.positions_m
    stretches = [sorted((frame, switch.frame)) for switch in motion.acting_switches if not switch.opens]
    ways_m = [positions_m[first : last + 1] - positions_m[frame] for first, last in stretches]
    return any(float(np.linalg.norm(way_m, axis=1).max()) <= TOLERANCE_M for way_m in ways_m)


def _bends(motion: Motion, leg: _Leg, most: float, most_in_joints: float) -> bool:
    """Return whether a motion consists of several: it bends in space and in joint space.

    So does one that turns a held object by half a turn or more.
    """
    path = motion.path(leg.first, leg.last, TOLERANCE_M, TOLERANCE_DEG)
    return path.turns_round or (path.bend > most and _bend_in_joints(motion, leg) > most_in_joints)


def _lifts(motion: Motion, leg: _Leg) -> bool:
    """Return whether the hand comes higher than where the motion begins and ends."""
    heights_m = motion.trajectory.positions_m[leg.first : leg.last + 1, 2]
    return bool(heights_m.max() > max(heights_m[0], heights_m[-1]) + TOLERANCE_M)


def _bend_in_joints(motion: Motion, leg: _Leg) -> float:
    """Return the deviation of the joints from a straight line in joint space, as a share of its length."""
    moved = slice(leg.first + 1, leg.last + 1)
    steps_s = np.diff(motion.times_s[leg.first : leg.last + 1])[:, None]
    way_rad = np.cumsum(motion.trajectory.joint_velocities_rad_s[moved] * steps_s, axis=0)
    end_rad = way_rad[-1]
    length_rad = max(float(np.linalg.norm(end_rad)), 1e-9)
    along = np.outer(way_rad @ end_rad / length_rad**2, end_rad)
    return float(np.linalg.norm(way_rad - along, axis=1).max()) / length_rad


def _few_missed_corners(motion: Motion, rests: npt.NDArray[np.bool_]) -> bool:
    """Return whether most corners of the path are at rests."""
    positions_m = motion.trajectory.positions_m
    way_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions_m, axis=0), axis=1))])
    corners_m = _corners_m(positions_m, way_m)
    rests_m = way_m[rests]
    missed = sum(bool(np.abs(rests_m - corner).min() > ARM_M) for corner in corners_m)
    return missed <= max(1.0, MISSED_CORNERS * len(corners_m))


def _corners_m(positions_m: Array, way_m: Array) -> list[float]:
    """Return the sharp corners of a path, each as the path length from the start."""
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
    """Return for each action the largest distance of the recorded path from straight motion to it from the one before.

    Args:
        actions: at frames of the recording, ascending; motion to the first starts at the first frame.
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
    """Return the largest of `paths_left_m` that matters.

    If a recording rests at its keyframes, the path between them is arbitrary, except the approach to a grasp or a
    release.

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
    """Return whether the actions leave more than a third of a plan's recordings by more than `LEFT_M`."""
    return sum(far_m > LEFT_M for far_m in left_m) > OFTEN_SHARE * len(left_m)
