"""Whether a recording rests at its keyframes, as scripted demonstrations do, or hesitates, as people do."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from app.pipeline.keyframes.path import HandPath
from app.pipeline.keyframes.rule import (
    MAX_KEYFRAMES,
    SIMULATION_DELTA_RAD_S,
    TOLERANCE_DEG,
    TOLERANCE_M,
    merged,
    resting_frames,
)
from app.pipeline.keyframes.waypoints import at_start, gripper_switches
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import Trajectory

Manner = Literal["rests", "hesitates", "flows"]

NEARBY_S = 0.1  # a switch this near to a rest happens in it
MAX_RESTING = 0.5  # a recording that rests longer than it moves was made by a person who hesitates
ON_THE_WAY = 0.2  # the share of keyframes that may lie on a straight way; one always may
STRAIGHT = 1.5  # tolerances
MAX_BENT = 0.25  # the share of grasps and releases that may be come to otherwise
BENT = 0.15  # of its length: a way in joint space that bends more is no single motion
WIDE, WINDING = 3.0, 0.3  # in tolerances, and of its length in joint space: a way that bends more has a corner
MISSED_CORNERS = 0.5  # the share of corners that may be passed without a rest; one always may
CORNER_DEG = 60.0
ARM_M, STEP_M = 0.03, 0.005  # a corner is recognised by the ways of this length before and after it
MIN_ARM_M = 0.01


def manner_of(trajectory: Trajectory, times_s: Array, delta_rad_s: float = SIMULATION_DELTA_RAD_S) -> Manner:
    """How a recording moves.

    `rests`: the rests are its keyframes, so that `merged` finds these. Every grasp and release happens in a rest, the
    hand comes to it in a straight motion, corners are turned in rests, and (nearly) every rest is at a corner.
    `hesitates`: it rests on straight ways or longer than it moves, as people do, whose hand wavers as well.
    `flows`: anything else, and an arm whose joints were not recorded.

    Args:
        times_s: (T,) of the frames.
    """
    if trajectory.num_joints == 0:
        return "flows"
    rests = resting_frames(trajectory, delta_rad_s)
    if not rests.any() or rests.all():
        return "flows"
    started = int(np.argmin(rests))
    switches = [switch.frame for switch in gripper_switches(trajectory, times_s) if not at_start(switch, trajectory)]
    keyframes = merged(trajectory, delta_rad_s)
    on_the_way = _num_on_the_way(trajectory, keyframes, switches, times_s)
    if float(rests[started:].mean()) > MAX_RESTING or on_the_way > max(1.0, ON_THE_WAY * len(keyframes)):
        return "hesitates"
    at_keyframes = (
        bool(rests[started:].any())
        and len(keyframes) <= MAX_KEYFRAMES
        and all(_rests_nearby(frame, rests, times_s) for frame in switches)
        and _straight_to_switches(trajectory, keyframes, switches, times_s)
        and not _passes_corners(trajectory, keyframes, times_s)
        and _few_missed_corners(trajectory, rests)
    )
    return "rests" if at_keyframes else "flows"


def _rests_nearby(frame: int, rests: npt.NDArray[np.bool_], times_s: Array) -> bool:
    return bool(rests[np.abs(times_s - times_s[frame]) <= NEARBY_S].any())


def _num_on_the_way(trajectory: Trajectory, keyframes: Sequence[int], switches: Sequence[int], times_s: Array) -> int:
    """How many keyframes could be left out without the path leaving straight motion."""
    number = 0
    for before, (here, after) in zip([0, *keyframes], pairwise(keyframes), strict=False):
        if any(abs(times_s[here] - times_s[frame]) <= NEARBY_S for frame in switches):
            continue
        number += HandPath.between(trajectory, before, after, TOLERANCE_M, TOLERANCE_DEG).bend <= 1
    return number


def _straight_to_switches(
    trajectory: Trajectory, keyframes: Sequence[int], switches: Sequence[int], times_s: Array
) -> bool:
    """Whether the hand comes to every grasp and release from the keyframe before in one straight motion.

    A person passes the pose above a thing without a rest, so that the way to the grasp has a corner.
    """
    bent = 0
    for before, here in pairwise([0, *keyframes]):
        if any(abs(times_s[here] - times_s[frame]) <= NEARBY_S for frame in switches):
            bend = HandPath.between(trajectory, before, here, TOLERANCE_M, TOLERANCE_DEG).bend
            bent += bend > STRAIGHT and _bend_in_joints(trajectory, before, here, times_s) > BENT
    return bent <= MAX_BENT * len(switches)


def _passes_corners(trajectory: Trajectory, keyframes: Sequence[int], times_s: Array) -> bool:
    """Whether some way between keyframes is several motions, in space and in the joints: a pose was passed on it."""
    return any(
        HandPath.between(trajectory, before, here, TOLERANCE_M, TOLERANCE_DEG).bend > WIDE
        and _bend_in_joints(trajectory, before, here, times_s) > WINDING
        for before, here in pairwise([0, *keyframes])
        if here > before + 1
    )


def _bend_in_joints(trajectory: Trajectory, first: int, last: int, times_s: Array) -> float:
    """How far the joints leave moving in proportion, as arms do on a free way, as a share of the length of the way."""
    steps_s = np.diff(times_s[first : last + 1])[:, None]
    way_rad = np.cumsum(trajectory.joint_velocities_rad_s[first + 1 : last + 1] * steps_s, axis=0)
    end_rad = way_rad[-1]
    length_rad = max(float(np.linalg.norm(end_rad)), 1e-9)
    along = np.outer(way_rad @ end_rad / length_rad**2, end_rad)
    return float(np.linalg.norm(way_rad - along, axis=1).max()) / length_rad


def _few_missed_corners(trajectory: Trajectory, rests: npt.NDArray[np.bool_]) -> bool:
    """Whether most corners of the path are turned at rest."""
    way_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1))])
    corners_m = _corners_m(trajectory.positions_m, way_m)
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
