"""What right recordings of people have, and those of a simulated expert have not."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from benchmarks.adversary.case import Case, Recording
from benchmarks.adversary.recordings import Change, frames, with_hand
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.trajectory import Trajectory

TREMBLES_M, TREMBLES_RAD = 0.002, 0.02  # a tracker's error, or a person's hand
FRAMES_OF_NOISE = 2.0  # over which it is smooth
HOLDS_S = 0.6  # fingers that have missed stay closed, and then open, so long
STRAYS_M, STRAYS = (0.04, 0.08), 6.0  # after a sixth of the recording as far
STRAYS_AT_M = 0.12  # from every object; nearer to one the hand is where it acts


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
        return _without_joints(with_hand(recording, given.positions_m + noise(number, TREMBLES_M), hands))

    return change


def waiting(case: Case, random: np.random.Generator) -> Change:
    """The hand stops somewhere for 0.5 to 1.5 s, elsewhere in each recording."""

    def change(recording: Recording) -> Recording:
        given, rate_hz = recording.trajectory, recording.control_frequency_hz
        stop, number = int(random.integers(1, len(given))), round(random.uniform(0.5, 1.5) * rate_hz)
        return replace(recording, trajectory=_resting(given, stop, number))

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


def grasping_again(case: Case, random: np.random.Generator) -> Change:
    """The fingers close, open and close again before the hand goes on."""

    def change(recording: Recording) -> Recording:
        given = recording.trajectory
        closes = np.flatnonzero(np.diff(given.gripper_open.astype(int)) < 0)
        if not len(closes):
            return recording
        frame, number = int(closes[0]) + 1, max(2, round(HOLDS_S * recording.control_frequency_hz))
        longer = _resting(given, frame, 2 * number)
        is_open = longer.gripper_open.copy()
        is_open[frame + number : frame + 2 * number] = True
        return replace(recording, trajectory=replace(longer, gripper_open=is_open))

    return change


def straying(case: Case, random: np.random.Generator) -> Change:
    """The hand strays by 4 to 8 cm on its way through free space; there are no joints."""

    def change(recording: Recording) -> Recording:
        given = recording.trajectory
        places_m = np.array([pose.position_m for pose in (*recording.objects, *recording.objects_after)])
        away_m = np.linalg.norm(given.positions_m[:, None] - places_m, axis=2).min(axis=1)
        ends = np.clip(STRAYS * np.minimum(np.arange(len(given)), np.arange(len(given))[::-1]) / len(given), 0, 1)
        free = gaussian_filter1d(np.clip(away_m / STRAYS_AT_M - 1, 0, 1), len(given) / 50)
        way = random.normal(size=3)
        off_m = random.uniform(*STRAYS_M) * (ends * free)[:, None] * way / np.linalg.norm(way)
        return _without_joints(with_hand(recording, given.positions_m + off_m))

    return change


def _without_joints(recording: Recording) -> Recording:
    given = recording.trajectory
    no_joints = replace(given, joint_velocities_rad_s=np.zeros((len(given), 0)), joint_positions_rad=None)
    return replace(recording, trajectory=no_joints)


def _resting(given: Trajectory, frame: int, number: int) -> Trajectory:
    """The trajectory with so many frames more, in which everything stays as it is in one."""
    longer = frames(
        replace(given, timestamps_s=None), np.r_[0 : frame + 1, np.full(number, frame), frame + 1 : len(given)]
    )
    speeds = longer.joint_velocities_rad_s.copy()
    speeds[frame : frame + number + 1] = 0.0
    return replace(longer, joint_velocities_rad_s=speeds)
