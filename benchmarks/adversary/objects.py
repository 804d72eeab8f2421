"""What goes wrong with objects, in a recording as in the scene that is asked about: their names and their poses."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.noise import disturbed
from benchmarks.adversary.case import Case, Mutation, Poses, mentioned
from benchmarks.adversary.recordings import Change, Fault, camera_frame, level, moved
from roboprompt_client.types import quaternions

PoseChange = Callable[[Poses], Poses]
PoseFault = Callable[[Case, np.random.Generator], PoseChange | None]
ESTIMATOR_DEG_PER_M = 4.61 / 0.0168  # as the paper's pose estimator errs


def of_recordings(fault: PoseFault) -> Fault:
    """The fault in the objects of a recording."""

    def of_case(case: Case, random: np.random.Generator) -> Change | None:
        change = fault(case, random)
        return None if change is None else lambda item: replace(item, objects=change(item.objects))

    return of_case


def in_question(fault: PoseFault) -> Mutation:
    """The fault in the scene that is asked about, the recordings as they were."""

    def mutate(case: Case, random: np.random.Generator) -> Case | None:
        change = fault(case, random)
        return None if change is None else replace(case, objects=change(case.objects))

    return mutate


def swapped(case: Case, random: np.random.Generator) -> PoseChange | None:
    """The object that is mentioned first and another are taken for each other."""
    if len(case.objects) < 2:
        return None
    one = case.main
    other = int(random.choice([k for k in range(len(case.objects)) if k != one]))

    def change(poses: Poses) -> Poses:
        changed = list(poses)
        changed[one] = replace(poses[other], name=poses[one].name)
        changed[other] = replace(poses[one], name=poses[other].name)
        return tuple(changed)

    return change


def taken_for_another(case: Case, random: np.random.Generator) -> PoseChange | None:
    """The object that is mentioned first is seen where another is."""
    exchange = swapped(case, random)
    if exchange is None:
        return None
    return lambda poses: (*poses[: case.main], exchange(poses)[case.main], *poses[case.main + 1 :])


def renamed(spelling: Callable[[str], str]) -> PoseFault:
    """The object that is mentioned first has its name in another spelling."""

    def fault(case: Case, random: np.random.Generator) -> PoseChange | None:
        if spelling(case.objects[case.main].name) == case.objects[case.main].name:
            return None
        return lambda poses: _with(poses, case.main, name=spelling(poses[case.main].name))

    return fault


def duplicated(spelling: Callable[[str], str]) -> PoseFault:
    """A second object, 15 to 25 cm beside the one that is mentioned first, has its name in another spelling."""

    def fault(case: Case, random: np.random.Generator) -> PoseChange:
        shift_m = level(random, 0.15, 0.25)

        def change(poses: Poses) -> Poses:
            main = poses[case.main]
            return (*poses, replace(main, name=spelling(main.name), position_m=main.position_m + shift_m))

        return change

    return fault


def shifted(least_m: float, most_m: float) -> PoseFault:
    """The object that is mentioned first is seen so far beside its place."""

    def fault(case: Case, random: np.random.Generator) -> PoseChange:
        shift_m = level(random, least_m, most_m)
        return lambda poses: _with(poses, case.main, position_m=poses[case.main].position_m + shift_m)

    return fault


def lifted(least_m: float, most_m: float) -> PoseFault:
    """The object that is mentioned first is seen so far above or below its place."""

    def fault(case: Case, random: np.random.Generator) -> PoseChange:
        shift_m = np.array([0.0, 0.0, random.choice([-1, 1]) * random.uniform(least_m, most_m)])
        return lambda poses: _with(poses, case.main, position_m=poses[case.main].position_m + shift_m)

    return fault


def height_scaled(case: Case, random: np.random.Generator) -> PoseChange:
    """The height of the object that is mentioned first is 0.7 to 1.5 times what it should be."""
    scale = np.array([1.0, 1.0, float(random.choice([0.7, 0.9, 1.1, 1.5]))])
    return lambda poses: _with(poses, case.main, position_m=poses[case.main].position_m * scale)


def places_scaled(case: Case, random: np.random.Generator) -> PoseChange:
    """All x and y are 0.9 or 1.1 times what they should be: a camera above the origin has a wrong focal length."""
    factor = float(random.choice([0.9, 1.1]))
    scale = np.array([factor, factor, 1.0])
    return lambda poses: tuple(replace(pose, position_m=scale * pose.position_m) for pose in poses)


def rotations_inverted(case: Case, random: np.random.Generator) -> PoseChange | None:
    """All objects' quaternions are those of the world seen from the object: yaws have the other sign."""
    if all(pose.quaternion_xyzw is None for pose in case.objects):
        return None
    return lambda poses: tuple(
        pose if (turn := pose.quaternion_xyzw) is None else replace(pose, quaternion_xyzw=quaternions.inverse(turn))
        for pose in poses
    )


def bystander_moved(case: Case, random: np.random.Generator) -> PoseChange | None:
    """An object that the instruction does not mention is seen 7 to 18 cm beside its place."""
    named = mentioned(case.instruction, case.objects)
    others = [k for k, pose in enumerate(case.objects) if pose.name not in named]
    if not others:
        return None
    which, shift_m = int(random.choice(others)), level(random, 0.07, 0.18)
    return lambda poses: _with(poses, which, position_m=poses[which].position_m + shift_m)


def upside_down(case: Case, random: np.random.Generator) -> PoseChange | None:
    """The object that is mentioned first stands on its head."""
    return _turned(case, Rotation.from_euler("x", 180, degrees=True), own=True)


def lying(case: Case, random: np.random.Generator) -> PoseChange | None:
    """The object that is mentioned first lies on its side."""
    return _turned(case, Rotation.from_euler("x", 90, degrees=True), own=True)


def turned(case: Case, random: np.random.Generator) -> PoseChange | None:
    """The object that is mentioned first is seen turned by 35 to 55 degrees about the vertical; none that is round."""
    symmetry = case.settings["yaw_symmetry_deg"].get(case.objects[case.main].name)
    if symmetry == 0:
        return None
    angle = random.choice([-1, 1]) * random.uniform(35, 55)
    return _turned(case, Rotation.from_euler("z", angle, degrees=True), own=False)


def wxyz(case: Case, random: np.random.Generator) -> PoseChange | None:
    """All objects' quaternions have w first."""
    if any(pose.quaternion_xyzw is None for pose in case.objects):
        return None
    return lambda poses: tuple(
        replace(pose, quaternion_xyzw=None if pose.quaternion_xyzw is None else pose.quaternion_xyzw[[3, 0, 1, 2]])
        for pose in poses
    )


def unturned(case: Case, random: np.random.Generator) -> PoseChange | None:
    """The estimator sees no rotations and says that all are the identity."""
    if all(pose.quaternion_xyzw is None for pose in case.objects):
        return None
    return lambda poses: tuple(replace(pose, quaternion_xyzw=quaternions.IDENTITY) for pose in poses)


def in_camera_frame(case: Case, random: np.random.Generator) -> PoseChange:
    """All objects are in the frame of a camera, which looks down at an angle."""
    shift_m, turn = camera_frame(random)
    return lambda poses: moved(poses, shift_m, turn)


def noisy(mean_error_m: float) -> PoseFault:
    """All poses err by so much, and by as many degrees as the paper's pose estimator does with them."""

    def fault(case: Case, random: np.random.Generator) -> PoseChange:
        error_rad = np.radians(mean_error_m * ESTIMATOR_DEG_PER_M)
        return lambda poses: disturbed(poses, random, mean_error_m=mean_error_m, mean_error_rad=error_rad)

    return fault


def underscored(name: str) -> str:
    """`red cube` as `red_cube`."""
    return name.replace(" ", "_")


def hyphenated(name: str) -> str:
    """`red cube` as `red-cube`."""
    return name.replace(" ", "-")


def _turned(case: Case, turn: Rotation, *, own: bool) -> PoseChange | None:
    """Turned about an axis of its own, or of the world."""
    if case.objects[case.main].quaternion_xyzw is None:
        return None

    def change(poses: Poses) -> Poses:
        given = Rotation.from_quat(poses[case.main].quaternion_xyzw)
        return _with(poses, case.main, quaternion_xyzw=(given * turn if own else turn * given).as_quat())

    return change


def _with(poses: Poses, which: int, **changed: object) -> Poses:
    return (*poses[:which], replace(poses[which], **changed), *poses[which + 1 :])  # type: ignore[arg-type]
