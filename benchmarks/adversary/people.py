"""What right recordings of people have, and those of a simulated expert have not."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from benchmarks.adversary.case import Case, Recording
from benchmarks.adversary.recordings import Change, frames, with_hand
from roboprompt_client.types.arrays import Array

TREMBLES_M, TREMBLES_RAD = 0.002, 0.02  # a tracker's error, or a person's hand
FRAMES_OF_NOISE = 2.0  # over which it is smooth


def trembling(case: Case, random: np.random.Generator) -> Change:
    """The hand is tracked within 2 mm and a degree; there are no joints, as a person holds the gripper."""

    def noise(number: int, scale: float) -> Array:
        white = random.normal(size=(number, 3))
        colored = gaussian_filter1d(white, FRAMES_OF_NOISE, axis=0)
        noisy: Array = scale * colored / max(float(colored.std()), 1e-9)
        return noisy

    def change(recording: Recording) -> Recording:
        given = recording.trajectory
        number = len(given)
        turns = Rotation.from_rotvec(noise(number, TREMBLES_RAD))
        hands = (turns * Rotation.from_quat(given.quaternions_xyzw)).as_quat()
        moved = with_hand(recording, given.positions_m + noise(number, TREMBLES_M), hands)
        no_joints = replace(moved.trajectory, joint_velocities_rad_s=np.zeros((number, 0)), joint_positions_rad=None)
        return replace(recording, trajectory=no_joints)

    return change


def waiting(case: Case, random: np.random.Generator) -> Change:
    """The hand stops somewhere for 0.5 to 1.5 s, elsewhere in each recording."""

    def change(recording: Recording) -> Recording:
        given, rate_hz = recording.trajectory, recording.control_frequency_hz
        stop, number = int(random.integers(1, len(given))), round(random.uniform(0.5, 1.5) * rate_hz)
        kept = np.r_[0 : stop + 1, np.full(number, stop), stop + 1 : len(given)]
        longer = frames(replace(given, timestamps_s=None), kept)
        speeds = longer.joint_velocities_rad_s.copy()
        speeds[stop : stop + number + 1] = 0.0
        return replace(recording, trajectory=replace(longer, joint_velocities_rad_s=speeds))

    return change


def at_its_own_speed(case: Case, random: np.random.Generator) -> Change:
    """Each recording has its own speed, from half to twice the expert's."""

    def change(recording: Recording) -> Recording:
        faster = 2.0 ** random.uniform(-1, 1)
        given = recording.trajectory
        times_s = None if given.timestamps_s is None else given.timestamps_s / faster
        moved = replace(given, timestamps_s=times_s, joint_velocities_rad_s=given.joint_velocities_rad_s * faster)
        return replace(recording, trajectory=moved, control_frequency_hz=recording.control_frequency_hz * faster)

    return change
