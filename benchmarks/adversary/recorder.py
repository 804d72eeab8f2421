"""What goes wrong in a recorder: its clocks, rate and filters, the frame and the point of the hand that it reports.

As in `recordings`, a fault draws its numbers once a case, but for `hand_misses`.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from app.pipeline.episode import frame_times_s
from benchmarks.adversary.case import Case, Recording
from benchmarks.adversary.recordings import Change, camera_frame, frames, hand_moved, level, with_hand
from roboprompt_client.types.arrays import Array

Y_UP = Rotation.from_euler("x", -90, degrees=True)


def gripper_late(case: Case, random: np.random.Generator) -> Change:
    """The gripper's clock is 0.4 to 1.5 s behind that of the poses."""
    lag_s = random.uniform(0.4, 1.5)
    return lambda recording: _gripper_of(recording, -lag_s)


def gripper_early(case: Case, random: np.random.Generator) -> Change:
    """The gripper's clock is 0.4 to 1.5 s ahead of that of the poses, as if its command was recorded."""
    lead_s = random.uniform(0.4, 1.5)
    return lambda recording: _gripper_of(recording, lead_s)


def gripper_stuck(case: Case, random: np.random.Generator) -> Change:
    """The gripper is said to be always open, or always closed."""
    is_open = bool(random.integers(2))

    def change(recording: Recording) -> Recording:
        states = np.full(len(recording.trajectory), is_open)
        return replace(recording, trajectory=replace(recording.trajectory, gripper_open=states))

    return change


def smoothed(case: Case, random: np.random.Generator) -> Change:
    """The hand's positions are means over 0.5 to 2 s."""
    over_s = random.uniform(0.5, 2.0)

    def change(recording: Recording) -> Recording:
        frames_of_mean = max(1, round(over_s * _rate_hz(recording)))
        given = recording.trajectory.positions_m
        means_m: Array = uniform_filter1d(given, frames_of_mean, axis=0, mode="nearest")
        return with_hand(recording, means_m)

    return change


def begun_late(case: Case, random: np.random.Generator) -> Change:
    """The first 40 to 60 % of the frames are missing."""
    return _without(0.0, random.uniform(0.4, 0.6))


def middle_missing(case: Case, random: np.random.Generator) -> Change:
    """A fifth to two fifths of the frames are missing in the middle."""
    first, share = random.uniform(0.2, 0.5), random.uniform(0.2, 0.4)
    return _without(first, first + share)


def sparse(case: Case, random: np.random.Generator) -> Change:
    """There is one frame in 1 to 2 s."""
    every_s = random.uniform(1.0, 2.0)

    def change(recording: Recording) -> Recording:
        step = max(1, round(every_s * _rate_hz(recording)))
        kept = frames(recording.trajectory, np.arange(0, len(recording.trajectory), step))
        times_s = recording.trajectory.timestamps_s
        kept = replace(kept, timestamps_s=None if times_s is None else times_s[::step])
        return replace(recording, trajectory=kept, control_frequency_hz=recording.control_frequency_hz / step)

    return change


def hand_in_tilted_frame(case: Case, random: np.random.Generator) -> Change:
    """The hand alone is in the frame of a camera, which looks down at an angle."""
    shift_m, turn = camera_frame(random)
    return lambda recording: hand_moved(recording, shift_m, turn)


def hand_with_y_up(case: Case, random: np.random.Generator) -> Change:
    """The hand alone is in a frame with y up."""
    return lambda recording: hand_moved(recording, np.zeros(3), Y_UP)


def hand_scaled(case: Case, random: np.random.Generator) -> Change:
    """The hand's way from the base is 8 to 25 % too long or too short."""
    factor = (1 + random.uniform(0.08, 0.25)) ** random.choice([-1, 1])
    return lambda recording: with_hand(recording, factor * recording.trajectory.positions_m)


def hand_turned_about_itself(case: Case, random: np.random.Generator) -> Change:
    """The hand's x and y axes are those of the flange, 45 degrees from the fingers'."""
    turn = Rotation.from_euler("z", random.choice([-45, 45]), degrees=True)

    def change(recording: Recording) -> Recording:
        given = recording.trajectory
        hands: Array = (Rotation.from_quat(given.quaternions_xyzw) * turn).as_quat()
        return with_hand(recording, given.positions_m, hands)

    return change


def hand_misses(case: Case, random: np.random.Generator) -> Change:
    """The hand passes 3 to 8 cm beside everything, in each recording elsewhere: demonstrations that failed."""
    return lambda recording: hand_moved(recording, level(random, 0.03, 0.08), Rotation.identity())


def clock_in_milliseconds(case: Case, random: np.random.Generator) -> Change:
    """Times are a thousand times too long."""

    def change(recording: Recording) -> Recording:
        times_s = recording.trajectory.timestamps_s
        slow = replace(recording.trajectory, timestamps_s=None if times_s is None else 1000 * times_s)
        return replace(recording, trajectory=slow, control_frequency_hz=recording.control_frequency_hz / 1000)

    return change


def joints_at_rest(case: Case, random: np.random.Generator) -> Change:
    """The joint velocities are all zero."""
    return _with_joints(lambda recording: np.zeros_like(recording.trajectory.joint_velocities_rad_s))


def joints_in_degrees(case: Case, random: np.random.Generator) -> Change:
    """The joint velocities are in degrees per second."""
    return _with_joints(lambda recording: np.degrees(recording.trajectory.joint_velocities_rad_s))


def joint_positions(case: Case, random: np.random.Generator) -> Change:
    """What should be joint velocities are joint positions."""

    def positions_rad(recording: Recording) -> Array:
        given = recording.trajectory.joint_velocities_rad_s
        return np.linspace(-1.5, 1.5, given.shape[1]) + np.cumsum(given, axis=0) / _rate_hz(recording)

    return _with_joints(positions_rad)


def _with_joints(velocities: Callable[[Recording], Array]) -> Change:
    def change(recording: Recording) -> Recording:
        given = recording.trajectory
        return replace(recording, trajectory=replace(given, joint_velocities_rad_s=velocities(recording)))

    return change


def _gripper_of(recording: Recording, after_s: float) -> Recording:
    """The recording with the gripper's states of the frames that come `after_s` later."""
    given = recording.trajectory
    times_s = frame_times_s(given, recording.control_frequency_hz)
    found = np.clip(np.searchsorted(times_s, times_s + after_s), 0, len(given) - 1)
    return replace(recording, trajectory=replace(given, gripper_open=given.gripper_open[found]))


def _without(first: float, end: float) -> Change:
    """Without the frames between two shares of a recording."""

    def change(recording: Recording) -> Recording:
        number = len(recording.trajectory)
        shares = np.arange(number) / number
        kept = np.flatnonzero((shares < first) | (shares >= end))
        return replace(recording, trajectory=frames(recording.trajectory, kept))

    return change


def _rate_hz(recording: Recording) -> float:
    times_s = frame_times_s(recording.trajectory, recording.control_frequency_hz)
    return 1 / max(float(np.median(np.diff(times_s))), 1e-3) if len(times_s) > 1 else recording.control_frequency_hz
