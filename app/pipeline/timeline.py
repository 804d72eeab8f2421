"""A trajectory over time."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import Trajectory

CONTROL_FREQUENCY_HZ = 20.0  # of RLBench's demonstrations


def frame_times_s(trajectory: Trajectory, control_frequency_hz: float = CONTROL_FREQUENCY_HZ) -> Array:
    """(T,) from the first frame on."""
    if trajectory.timestamps_s is not None:
        return trajectory.timestamps_s - float(trajectory.timestamps_s[0])
    times_s: Array = np.arange(len(trajectory)) / control_frequency_hz
    return times_s


def gripper_stretches(gripper_open: Sequence[bool]) -> list[tuple[int, int, bool]]:
    """First frame, frame after the last, and state of each stretch in which the gripper stays open or closed."""
    edges = [0, *(np.flatnonzero(np.diff(gripper_open)) + 1).tolist(), len(gripper_open)]
    return [(first, end, bool(gripper_open[first])) for first, end in pairwise(edges)]
