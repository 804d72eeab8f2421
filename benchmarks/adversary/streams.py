"""What goes wrong in the streams that a recorder joins: they drift, freeze, arrive out of order, or never stop.

As in `recordings`, a fault draws its numbers once a case, but for `drifting` and `out_of_order`.
"""

from dataclasses import fields, replace

import numpy as np

from benchmarks.adversary.case import Case, Recording
from benchmarks.adversary.recordings import Change, frames, level, with_hand
from roboprompt_client.types import quaternions
from roboprompt_client.types.trajectory import Trajectory

XY_EXCHANGED = [1, 0, 2]
LATE_FRAMES = 8  # a frame arrives so many frames later or earlier at most


def drifting(case: Case, random: np.random.Generator) -> Change:
    """The hand's position drifts by 4 to 10 cm until the end, in each recording another way."""

    def change(recording: Recording) -> Recording:
        share = np.linspace(0, 1, len(recording.trajectory))[:, None]
        return with_hand(recording, recording.trajectory.positions_m + share * level(random, 0.04, 0.10))

    return change


def frozen(case: Case, random: np.random.Generator) -> Change:
    """The hand's pose stays for 15 to 30 % of the frames, and then is where the hand is by then."""
    first, share = random.uniform(0.2, 0.6), random.uniform(0.15, 0.3)

    def change(recording: Recording) -> Recording:
        given = recording.trajectory
        frame = np.arange(len(given))
        start, end = round(first * len(given)), round((first + share) * len(given))
        shown = np.where((frame >= start) & (frame < end), start, frame)
        return with_hand(recording, given.positions_m[shown], given.quaternions_xyzw[shown])

    return change


def out_of_order(case: Case, random: np.random.Generator) -> Change:
    """Frames are stored as they arrived, some before others that are older."""

    def change(recording: Recording) -> Recording:
        number = len(recording.trajectory)
        arrival = np.argsort(np.arange(number) + random.uniform(0, LATE_FRAMES, number))
        return replace(recording, trajectory=frames(recording.trajectory, arrival))

    return change


def axes_exchanged(case: Case, random: np.random.Generator) -> Change:
    """The hand's x and y are exchanged."""
    return lambda recording: with_hand(recording, recording.trajectory.positions_m[:, XY_EXCHANGED])


def from_its_start(case: Case, random: np.random.Generator) -> Change:
    """The hand's positions are counted from where it started."""

    def change(recording: Recording) -> Recording:
        positions_m = recording.trajectory.positions_m
        return with_hand(recording, positions_m - positions_m[0])

    return change


def hand_unturned(case: Case, random: np.random.Generator) -> Change:
    """The hand's rotation was not recorded: it is the identity throughout."""

    def change(recording: Recording) -> Recording:
        given = recording.trajectory
        return with_hand(recording, given.positions_m, np.tile(quaternions.IDENTITY, (len(given), 1)))

    return change


def not_stopped(case: Case, random: np.random.Generator) -> Change:
    """The recorder was not stopped: the recording goes on into the next one."""
    after = dict(zip(map(id, case.recordings), (*case.recordings[1:], case.recordings[0]), strict=True))

    def change(recording: Recording) -> Recording:
        return replace(recording, trajectory=_joined(recording.trajectory, after[id(recording)].trajectory))

    return change


def _joined(one: Trajectory, other: Trajectory) -> Trajectory:
    """The frames of both; the second begins one frame after the first has ended."""
    arrays = {
        item.name: np.concatenate([value, getattr(other, item.name)])
        for item in fields(one)
        if (value := getattr(one, item.name)) is not None and item.name != "timestamps_s"
    }
    times_s = None
    if one.timestamps_s is not None and other.timestamps_s is not None:
        start_s = one.timestamps_s[-1] + other.timestamps_s[1] - 2 * other.timestamps_s[0]
        times_s = np.concatenate([one.timestamps_s, start_s + other.timestamps_s])
    return replace(one, **arrays, timestamps_s=times_s)
