"""What goes wrong, on purpose: with what a robot sees, with what a task was taught, with words."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from app.evaluation.paper import disturbed
from app.pipeline.noise import MEAN_ERROR_M
from app.pipeline.order.order import clause_of
from app.sim.demonstrate import Recordings
from app.sim.outcomes import RecordedDemonstration, SceneView
from roboprompt_client.trajectory import ObjectPose

Poses = tuple[ObjectPose, ...]
ELSEWHERE_M = 0.20
ODD_ONE = 4  # which of the demonstrations has its objects wrong
STREAM = 11  # keeps these draws apart from those of the scene


@dataclass(frozen=True)
class Teaching:
    """How a task is taught.

    Attributes:
        taught_poses: the objects of each demonstration as they are uploaded.
    """

    name: str
    taught_poses: Callable[[Sequence[RecordedDemonstration]], list[Poses]]
    recordings: Recordings = "rests"


@dataclass(frozen=True)
class Condition:
    """A way to ask.

    Attributes:
        seen: the poses that the robot reports; None where the scene has no such error.
        words: the instruction that is sent.
        one_in: only every so many tasks.
    """

    name: str
    lesson: Teaching
    seen: Callable[[SceneView], Poses | None]
    words: Callable[[str], str] = str
    options: Mapping[str, Any] = field(default_factory=lambda: {"model": "nearest"})
    one_in: int = 1


def _true(scene: SceneView) -> Poses:
    return scene.objects


def _noisy(mean_error_m: float) -> Callable[[SceneView], Poses]:
    return lambda scene: disturbed(scene.objects, mean_error_m / MEAN_ERROR_M, scene.seed)


def _main(scene: SceneView) -> int:
    """The object that the instruction mentions first; the first of all where it mentions none."""
    names = tuple(pose.name for pose in scene.objects)
    mentioned = clause_of(scene.instruction, names).objects
    return names.index(mentioned[0]) if mentioned else 0


def _swapped(scene: SceneView) -> Poses | None:
    """The main object and another are taken for each other."""
    if len(scene.objects) < 2:
        return None
    poses, one = list(scene.objects), _main(scene)
    other = [k for k in range(len(poses)) if k != one][scene.seed % (len(poses) - 1)]
    poses[one], poses[other] = replace(poses[other], name=poses[one].name), replace(poses[one], name=poses[other].name)
    return tuple(poses)


def _taken_for_another(scene: SceneView) -> Poses | None:
    """The main object is found where another is."""
    swapped = _swapped(scene)
    if swapped is None:
        return None
    poses, one = list(scene.objects), _main(scene)
    poses[one] = swapped[one]
    return tuple(poses)


def _elsewhere(scene: SceneView) -> Poses:
    """Something else on the table, 20 cm away and turned, is taken for the main object."""
    random, poses, one = np.random.default_rng((STREAM, scene.seed)), list(scene.objects), _main(scene)
    angle, yaw = random.uniform(-np.pi, np.pi, 2)
    shift_m = ELSEWHERE_M * np.array([np.cos(angle), np.sin(angle), 0.0])
    quaternion = poses[one].quaternion_xyzw
    if quaternion is not None:
        quaternion = (Rotation.from_euler("z", yaw) * Rotation.from_quat(quaternion)).as_quat()
    poses[one] = replace(poses[one], position_m=poses[one].position_m + shift_m, quaternion_xyzw=quaternion)
    return tuple(poses)


def _as_they_are(recorded: Sequence[RecordedDemonstration]) -> list[Poses]:
    return [item.scene.objects for item in recorded]


def _one_wrong(recorded: Sequence[RecordedDemonstration]) -> list[Poses]:
    """One demonstration comes with the objects of the next."""
    poses = _as_they_are(recorded)
    of = {pose.name: pose for pose in poses[ODD_ONE + 1]}
    poses[ODD_ONE] = tuple(of.get(pose.name, pose) for pose in poses[ODD_ONE])
    return poses


def _all_noisy(recorded: Sequence[RecordedDemonstration]) -> list[Poses]:
    """Every demonstration with the errors of the paper's pose estimator."""
    return [disturbed(item.scene.objects, 1.0, item.scene.seed) for item in recorded]


CLEAN = Teaching("clean", _as_they_are)
ONE_WRONG = Teaching("one-wrong", _one_wrong)
GUIDED = Teaching("continuous", _as_they_are, "continuous")
GUIDED_NOISY = Teaching("continuous-noisy", _all_noisy, "continuous")
REGRESSION = {"model": "regression"}
ALLOWED = {"model": "nearest", "unfamiliar": "allow"}

CONDITIONS = (
    Condition("clean", CLEAN, _true),
    Condition("observation 1 cm off", CLEAN, _noisy(0.01)),
    Condition("observation 3 cm off", CLEAN, _noisy(0.03)),
    Condition("two objects swapped", CLEAN, _swapped),
    Condition("object taken for another", CLEAN, _taken_for_another),
    Condition("object seen 20 cm away", CLEAN, _elsewhere),
    Condition("one demonstration's objects wrong", ONE_WRONG, _true),
    Condition("continuous demonstrations", GUIDED, _true, one_in=2),
    Condition("continuous demonstrations, poses 1.7 cm off", GUIDED_NOISY, _true, one_in=2),
    Condition("unknown words", CLEAN, _true, lambda words: f"{words}, but gently", one_in=4),
    Condition("unknown words, allowed", CLEAN, _true, lambda words: f"{words}, but gently", ALLOWED, one_in=4),
    Condition("regression, clean", CLEAN, _true, options=REGRESSION, one_in=3),
    Condition("regression, observation 3 cm off", CLEAN, _noisy(0.03), options=REGRESSION, one_in=3),
)
