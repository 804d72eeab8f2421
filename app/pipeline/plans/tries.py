"""Second tries: fingers close, open and close again at one place, and then carry something, as those of a person.

Where most recordings of an instruction do so once, those with a second try are read as if the first had not been: they
do the task in the same way.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.keyframes import Motion
from app.pipeline.keyframes.motion import FLICKERS_S
from app.pipeline.plans.recording import Recording

AGAIN_M = 0.02  # a hand that moves farther in between does something else; one that never does squeezes something


def without_tries(group: Sequence[Recording]) -> list[Recording]:
    """Return recordings of one form of instruction, without first tries that most others do not have."""
    often = Counter(recording.signature for recording in group)
    found = []
    for recording in group:
        once = _without_tries(recording)
        found.append(once if often[once.signature] > often[recording.signature] else recording)
    return found


def _without_tries(recording: Recording) -> Recording:
    """Return the recording as if the gripper had stayed open until it closes for the last time at a place."""
    motion = recording.motion
    while (tried := _tried(motion)) is not None:
        is_open = motion.trajectory.gripper_open.copy()
        is_open[tried] = True
        motion = Motion(replace(motion.trajectory, gripper_open=is_open), motion.times_s)
    return recording if motion is recording.motion else replace(recording, motion=motion)


def _tried(motion: Motion) -> slice | None:
    """Return the frames from a try to the next closing at its place, from which the hand carries something; or None."""
    changes = (*motion.gripper_changes, len(motion) - 1)
    for closes, opens, again, end in zip(changes, changes[1:], changes[2:], changes[3:], strict=False):
        stays = _reach_m(motion, closes, again) < AGAIN_M < _reach_m(motion, again, end)
        flickers = motion.times_s[again] - motion.times_s[opens] < FLICKERS_S
        if motion.trajectory.gripper_open[opens] and stays and not flickers:
            return slice(closes, again)
    return None


def _reach_m(motion: Motion, first: int, last: int) -> float:
    """Return how far the hand comes from its place in frame `first` until frame `last`."""
    positions_m = motion.trajectory.positions_m[first : last + 1]
    return float(np.linalg.norm(positions_m - positions_m[0], axis=1).max())
