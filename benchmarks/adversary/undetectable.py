"""Which wrong cases nothing that a service receives could tell from a right one.

The argument: only the scene of the question differs from the right case, and that scene is one that the recordings make
as likely as the right one. A robot that truly stands before it would then send the very same requests, so that a rule
that stops this case would stop that robot, too.
"""

from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.adversary.case import Case, Poses
from roboprompt_client.types.arrays import Array

ROUNDING = 1e-3  # m, and rad of rotations: what never varies in recordings is equal within this
REPEATED_M = 1e-5  # no two measurements of one place are as near to each other


def undetectable(right: Case, sent: Case) -> bool:
    """Return whether the case that is sent differs from the right one in a scene alone that recordings do not exclude.

    Places and rotations of objects, in the world and seen from each other, and their distances lie within what
    recordings show, widened by its width / (N - 1) at either end: the unbiased estimate of the range of which N values
    were drawn evenly. No object is where a recording has it to 0.01 mm, which no measurement repeats, nor is a
    rotation exactly the identity that was not.
    """
    if sent.recordings is not right.recordings or _said(sent) != _said(right):
        return False
    shown = [item.objects for item in sent.recordings]
    names = [pose.name for pose in sent.objects]
    if len(shown) < 2 or any([pose.name for pose in poses] != names for poses in (*shown, right.objects)):
        return False
    if any(_repeats(sent.objects, poses, right.objects) for poses in shown) or _unturned(sent.objects, right.objects):
        return False
    values = np.array([_quantities(poses, shown[0]) for poses in shown])
    low, high = values.min(axis=0), values.max(axis=0)
    slack = (high - low) / (len(shown) - 1) + ROUNDING
    asked = _quantities(sent.objects, shown[0])
    return bool((asked >= low - slack).all() and (asked <= high + slack).all())


def _said(case: Case) -> tuple[object, ...]:
    return case.instruction, repr(case.settings), repr(case.options), case.end_effector


def _repeats(asked: Poses, shown: Poses, right: Poses) -> bool:
    """Return whether an object that is seen elsewhere than it is has exactly its place in a recording."""
    return any(
        np.abs(pose.position_m - old.position_m).max() < REPEATED_M
        and not np.array_equal(pose.position_m, own.position_m)
        for pose, old, own in zip(asked, shown, right, strict=True)
    )


def _unturned(asked: Poses, right: Poses) -> bool:
    """Return whether an object has no rotation that has one."""
    turns = ((one.quaternion_xyzw, other.quaternion_xyzw) for one, other in zip(asked, right, strict=True))
    return any(one is not None and not one[:3].any() and other is not None and other[:3].any() for one, other in turns)


def _quantities(poses: Poses, origin: Poses) -> Array:
    """Return (K,) places, rotations from those of `origin`, and places and distances of objects seen from others."""
    turns = [Rotation.identity() if p.quaternion_xyzw is None else Rotation.from_quat(p.quaternion_xyzw) for p in poses]
    first = [
        Rotation.identity() if p.quaternion_xyzw is None else Rotation.from_quat(p.quaternion_xyzw) for p in origin
    ]
    found = [pose.position_m for pose in poses]
    found += [(old.inv() * turn).as_rotvec() for old, turn in zip(first, turns, strict=True)]
    for one, other in permutations(range(len(poses)), 2):
        away_m = poses[one].position_m - poses[other].position_m
        found += [away_m, turns[other].inv().apply(away_m), np.array([np.linalg.norm(away_m)])]
    return np.concatenate(found)
