"""The keyframes of one recording: near its path, and near those of the other demonstrations of its plan."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.keyframes import Keyframe
from app.pipeline.keyframes.path import HandPath
from app.pipeline.keyframes.waypoint_choice import at_frames, at_tips, best_waypoints
from app.pipeline.plans.recording import Recording
from app.pipeline.plans.rows import PlanRow
from app.pipeline.representation.anchors import anchor_pose, tilted_objects
from app.pipeline.thresholds import M_PER_RAD
from roboprompt_client.types.arrays import Array

TOGETHER_WEIGHT = 0.3  # of the squared distance between demonstrations, relative to the squared deviation of the path
MAX_DISTANCE = 3.0  # in tolerances; larger distances between demonstrations cost no more

Distances = Callable[[HandPath, int], Array]
"""From a path and a keyframe's number: (N,) distances of its poses from that keyframe of others, in tolerances."""


def choose(recording: Recording, numbers: Sequence[int], distances: Distances | None) -> list[Keyframe]:
    """Return the best keyframes of one recording, with these numbers in the phases.

    Args:
        distances: from the other demonstrations, a second cost; None: only the deviation from the path counts.
    """
    found: list[Keyframe] = []
    for phase, path, number in zip(recording.phases, recording.paths, numbers, strict=True):
        if number == 1:  # the end of the phase
            found += at_frames(phase, [phase.last])
            continue
        costs = None
        if distances is not None:
            off = np.array([distances(path, k) for k in range(len(found), len(found) + number)])
            costs = TOGETHER_WEIGHT * np.minimum(off, MAX_DISTANCE) ** 2
        frames = [int(path.frames[k]) for k in best_waypoints(path.deviations, number, costs)]
        if distances is None:
            frames = at_tips(recording.motion.trajectory.positions_m, phase.first, frames, recording.rule.tolerance_m)
        found += at_frames(phase, frames)
    return found


def off_rows(recording: Recording, rows: Sequence[PlanRow], place: int, path: HandPath, k: int) -> Array:
    """Return `Distances` from the centers of rows, in which the recording has index `place`."""
    demonstration, row = recording.demonstration, rows[k]
    origin = anchor_pose(row.anchors[place], demonstration, tilted_objects([demonstration]))
    trajectory = recording.motion.trajectory
    hands = Rotation.from_quat(trajectory.quaternions_xyzw[path.frames])
    offsets_m, rotations = origin.seen(trajectory.positions_m[path.frames], hands)
    off_m = np.linalg.norm(offsets_m - row.center_m, axis=1)
    off_m += M_PER_RAD * (row.mean_rotation.inv() * rotations).magnitude()
    distances: Array = off_m / recording.rule.tolerance_m
    return distances


def off_one(recording: Recording, shown: Recording, keyframes: Sequence[Keyframe], path: HandPath, k: int) -> Array:
    """Return `Distances` from the keyframes of one demonstration, each the least over the world and all objects."""
    places_m = recording.motion.trajectory.positions_m[path.frames]
    shown_m = shown.motion.trajectory.positions_m[keyframes[k].frame]
    objects = zip(recording.demonstration.ordered_objects, shown.demonstration.ordered_objects, strict=True)
    moved_m = np.array([np.zeros(3), *(here.position_m - there.position_m for here, there in objects)])
    off_m = np.linalg.norm(places_m - (shown_m + moved_m)[:, None], axis=2).min(axis=0)
    distances: Array = off_m / recording.rule.tolerance_m
    return distances
