"""Second tries: fingers close, open and close again at one place, as those of a person that missed something.

Where most recordings of an instruction do so once, those with a second try are read as if the first had not been: they
do the task in the same way.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.keyframes import Motion
from app.pipeline.plans.recording import Recording
from roboprompt_client.types.arrays import Array

AGAIN_M = 0.02  # a hand that moves farther in between does something else


def without_tries(group: Sequence[Recording]) -> list[Recording]:
    """Return recordings of one form of instruction, without first tries that most others do not have."""
    often = Counter(recording.signature for recording in group)
    found = []
    for recording in group:
        once = _without_tries(recording)
        found.append(once if often[once.signature] > often[recording.signature] else recording)
    return found


def _without_tries(recording: Recording) -> Recording:
    """Return the recording with the last of several switches at one place only, as if the gripper had waited for it."""
    trajectory, changes = recording.motion.trajectory, list(recording.motion.gripper_changes)
    is_open = trajectory.gripper_open.copy()
    while (first := _tried(trajectory.positions_m, changes)) is not None:
        begins, again, ends = changes[first : first + 3]
        is_open[begins:ends] = is_open[again]
        del changes[first : first + 2]
    if np.array_equal(is_open, trajectory.gripper_open):
        return recording
    motion = Motion(replace(trajectory, gripper_open=is_open), recording.motion.times_s)
    return replace(recording, motion=motion)


def _tried(positions_m: Array, changes: Sequence[int]) -> int | None:
    """Return the first of three successive changes of the gripper at one place; None if there are none."""
    for k in range(len(changes) - 2):
        between_m = positions_m[changes[k] : changes[k + 2] + 1]
        if np.linalg.norm(between_m - between_m[0], axis=1).max() < AGAIN_M:
            return k
    return None
