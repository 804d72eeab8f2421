"""What goes wrong in a recording: its frame, its hand, its gripper, its time.

A fault draws its numbers once a case, so that every recording that has it has the same.
"""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.adversary.case import Case, Mutation, Poses, Recording
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.trajectory import Trajectory

Change = Callable[[Recording], Recording]
Fault = Callable[[Case, np.random.Generator], Change | None]
MIRROR = np.array([1.0, -1.0, 1.0])  # the plane y = 0
MIRROR_XYZW = np.array([-1.0, 1.0, -1.0, 1.0])
KEPT_SHARE = 0.4  # of a recording that breaks off


def in_all(fault: Fault) -> Mutation:
    """Every recording has the fault."""
    return _in(fault, lambda number: number)


def in_some(fault: Fault) -> Mutation:
    """Three of ten recordings, drawn at random, have the fault."""
    return _in(fault, lambda number: 3 * number // 10)


def in_half(fault: Fault) -> Mutation:
    """One half of the recordings, drawn at random, has the fault."""
    return _in(fault, lambda number: number // 2)


def in_one(fault: Fault) -> Mutation:
    """One recording, drawn at random, has the fault."""
    return _in(fault, lambda number: 1)


def _in(fault: Fault, how_many: Callable[[int], int]) -> Mutation:
    def mutate(case: Case, random: np.random.Generator) -> Case | None:
        number = len(case.recordings)
        chosen = set(random.permutation(number)[: how_many(number)].tolist())
        change = fault(case, random)
        if change is None:
            return None
        changed = (change(item) if k in chosen else item for k, item in enumerate(case.recordings))
        return replace(case, recordings=tuple(changed))

    return mutate


def frame_moved(case: Case, random: np.random.Generator) -> Change:
    """Hand and objects are in another base frame: 20 to 60 cm away, turned by 90 or 180 degrees."""
    shift_m, turn = level(random, 0.2, 0.6), Rotation.from_euler("z", random.choice([-90, 90, 180]), degrees=True)

    return lambda recording: all_moved(recording, shift_m, turn)


def hand_shifted(case: Case, random: np.random.Generator) -> Change:
    """The hand alone is in another frame, 6 to 30 cm away."""
    shift_m = level(random, 0.06, 0.3)
    return lambda recording: hand_moved(recording, shift_m, Rotation.identity())


def hand_turned(case: Case, random: np.random.Generator) -> Change:
    """The hand alone is in a frame that is turned about the base's z axis by 90 or 180 degrees."""
    turn = Rotation.from_euler("z", random.choice([-90, 90, 180]), degrees=True)
    return lambda recording: hand_moved(recording, np.zeros(3), turn)


def hand_lifted(case: Case, random: np.random.Generator) -> Change:
    """The hand's pose is that of the flange, not of the fingers: 5 to 12 cm further up."""
    shift_m = np.array([0.0, 0.0, random.uniform(0.05, 0.12)])
    return lambda recording: hand_moved(recording, shift_m, Rotation.identity())


def mirrored(case: Case, random: np.random.Generator) -> Change:
    """Hand and objects have their y axis reversed."""

    def change(recording: Recording) -> Recording:
        objects = tuple(
            replace(
                pose,
                position_m=pose.position_m * MIRROR,
                quaternion_xyzw=None if pose.quaternion_xyzw is None else pose.quaternion_xyzw * MIRROR_XYZW,
            )
            for pose in recording.objects
        )
        return replace(_hand_mirrored(recording), objects=objects)

    return change


def hand_mirrored(case: Case, random: np.random.Generator) -> Change:
    """The hand alone has its y axis reversed."""
    return _hand_mirrored


def hand_in_millimeters(case: Case, random: np.random.Generator) -> Change:
    """The hand's positions are a thousand times what they should be."""
    return lambda recording: with_hand(recording, 1000 * recording.trajectory.positions_m)


def gripper_inverted(case: Case, random: np.random.Generator) -> Change:
    """The gripper is open where it is said to be closed."""

    def change(recording: Recording) -> Recording:
        trajectory = recording.trajectory
        return replace(recording, trajectory=replace(trajectory, gripper_open=~trajectory.gripper_open))

    return change


def quaternions_wxyz(case: Case, random: np.random.Generator) -> Change:
    """The hand's quaternions have w first."""

    def change(recording: Recording) -> Recording:
        return with_hand(
            recording, recording.trajectory.positions_m, recording.trajectory.quaternions_xyzw[:, [3, 0, 1, 2]]
        )

    return change


def hand_rotations_inverted(case: Case, random: np.random.Generator) -> Change:
    """The hand's quaternions are those of the world seen from the hand."""

    def change(recording: Recording) -> Recording:
        given = recording.trajectory
        return with_hand(recording, given.positions_m, quaternions.inverse(given.quaternions_xyzw))

    return change


def objects_after(case: Case, random: np.random.Generator) -> Change | None:
    """The objects are where they stand after the motion."""
    if not all(recording.objects_after for recording in case.recordings):
        return None
    return lambda recording: replace(recording, objects=recording.objects_after)


def reversed_in_time(case: Case, random: np.random.Generator) -> Change:
    """The last frame comes first; the objects are where they were before the motion."""

    def change(recording: Recording) -> Recording:
        trajectory = frames(recording.trajectory, slice(None, None, -1))
        return replace(
            recording, trajectory=replace(trajectory, joint_velocities_rad_s=-trajectory.joint_velocities_rad_s)
        )

    return change


def broken_off(case: Case, random: np.random.Generator) -> Change:
    """The recording ends after 40 % of its frames."""

    def change(recording: Recording) -> Recording:
        kept = max(2, round(KEPT_SHARE * len(recording.trajectory)))
        return replace(recording, trajectory=frames(recording.trajectory, slice(0, kept)))

    return change


def of_another_task(case: Case, random: np.random.Generator) -> Change | None:
    """The motion is that of another task, beside the objects of this one."""
    if not case.others:
        return None
    motions = iter(case.others * len(case.recordings))
    return lambda recording: replace(recording, trajectory=next(motions).trajectory)


def with_objects_of_another_task(case: Case, random: np.random.Generator) -> Change | None:
    """Motion and objects are those of another task, the objects under the names of this one."""
    if not case.others or len(case.others[0].objects) < len(case.objects):
        return None
    whole = iter(case.others * len(case.recordings))

    def change(recording: Recording) -> Recording:
        other = next(whole)
        renamed = (replace(pose, name=own.name) for pose, own in zip(other.objects, recording.objects, strict=False))
        return replace(recording, trajectory=other.trajectory, objects=tuple(renamed))

    return change


def all_moved(recording: Recording, shift_m: Array, turn: Rotation) -> Recording:
    """Hand and objects turned about the base and shifted."""
    return replace(hand_moved(recording, shift_m, turn), objects=moved(recording.objects, shift_m, turn))


def level(random: np.random.Generator, least_m: float, most_m: float) -> Array:
    """A shift (3,) in the plane of the table, of a length between the two."""
    angle, far_m = random.uniform(-np.pi, np.pi), random.uniform(least_m, most_m)
    return far_m * np.array([np.cos(angle), np.sin(angle), 0.0])


def camera_frame(random: np.random.Generator) -> tuple[Array, Rotation]:
    """Where the world is in the frame of a camera that looks down at an angle: its shift (3,) and rotation."""
    turn = Rotation.from_euler("zx", [random.uniform(-180, 180), random.uniform(100, 160)], degrees=True)
    return np.array([*level(random, 0.2, 0.8)[:2], random.uniform(0.4, 1.0)]), turn


def with_hand(recording: Recording, positions_m: Array, quaternions_xyzw: Array | None = None) -> Recording:
    """The recording with other positions of the hand, and other rotations where they are given."""
    given = recording.trajectory
    turned = given.quaternions_xyzw if quaternions_xyzw is None else quaternions_xyzw
    return replace(recording, trajectory=replace(given, positions_m=positions_m, quaternions_xyzw=turned))


def frames(trajectory: Trajectory, kept: slice | npt.NDArray[np.intp]) -> Trajectory:
    """These of its frames, at the times of as many first ones."""
    arrays = {
        item.name: value[kept]
        for item in fields(trajectory)
        if (value := getattr(trajectory, item.name)) is not None and item.name != "timestamps_s"
    }
    times_s = trajectory.timestamps_s
    return replace(
        trajectory, **arrays, timestamps_s=None if times_s is None else times_s[: len(arrays["positions_m"])]
    )


def _hand_mirrored(recording: Recording) -> Recording:
    given = recording.trajectory
    return with_hand(recording, given.positions_m * MIRROR, given.quaternions_xyzw * MIRROR_XYZW)


def hand_moved(recording: Recording, shift_m: Array, turn: Rotation) -> Recording:
    """The hand alone turned about the base and shifted."""
    given = recording.trajectory
    turned = (turn * Rotation.from_quat(given.quaternions_xyzw)).as_quat()
    return with_hand(recording, _rotated(turn, given.positions_m) + shift_m, turned)


def moved(poses: Poses, shift_m: Array, turn: Rotation) -> Poses:
    """Objects turned about the base and shifted."""
    return tuple(
        replace(
            pose,
            position_m=_rotated(turn, pose.position_m) + shift_m,
            quaternion_xyzw=None
            if pose.quaternion_xyzw is None
            else (turn * Rotation.from_quat(pose.quaternion_xyzw)).as_quat(),
        )
        for pose in poses
    )


def _rotated(turn: Rotation, points_m: Array) -> Array:
    """Points (..., 3); SciPy's own takes no array that is read-only."""
    turned: Array = points_m @ turn.as_matrix().T
    return turned
