"""What a robot sends in one case: its recordings, and the scene that it asks about."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from app.evaluation.world import World
from app.pipeline.order.order import Order
from app.sim.outcomes import RecordedDemonstration, SceneView
from roboprompt_client.types.poses import ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory

Poses = tuple[ObjectPose, ...]


@dataclass(frozen=True, eq=False)
class Recording:
    """One upload.

    Attributes:
        objects: where they are said to be at its first frame.
        objects_after: where they are at its last one; not uploaded.
    """

    instruction: str
    objects: Poses
    trajectory: Trajectory
    control_frequency_hz: float
    objects_after: Poses = ()


@dataclass(frozen=True, eq=False)
class Case:
    """Everything that is sent of one task.

    Attributes:
        instruction, objects: of the scene that is asked about.
        settings: of the task at the service.
        options: of `POST /predict`.
        others: recordings of another task.
        end_effector: where the robot says that its hand is; None where it does not say.
    """

    recordings: tuple[Recording, ...]
    instruction: str
    objects: Poses
    settings: Mapping[str, Any]
    options: Mapping[str, Any] = field(default_factory=dict)
    others: tuple[Recording, ...] = ()
    end_effector: Pose | None = None

    @property
    def main(self) -> int:
        """The object that the instruction mentions first; the first of all where it mentions none."""
        names = [pose.name for pose in self.objects]
        named = mentioned(self.instruction, self.objects)
        return names.index(named[0]) if named else 0


# What makes a case wrong; None where the case offers no way to.
Mutation = Callable[[Case, np.random.Generator], Case | None]


def mentioned(instruction: str, objects: Poses) -> tuple[str, ...]:
    """The names of the objects that the instruction mentions, in its order."""
    return Order(instruction, tuple(pose.name for pose in objects)).objects


def recording_of(recorded: RecordedDemonstration) -> Recording:
    """A demonstration as it is uploaded, its objects not tracked."""
    trajectory = replace(recorded.trajectory, object_positions_m=None, object_quaternions_xyzw=None)
    scene = recorded.scene
    after = recorded.trajectory.objects_at(-1, [pose.name for pose in scene.objects])
    return Recording(scene.instruction, scene.objects, trajectory, recorded.control_frequency_hz, after)


def unchanged_case(
    world: World, recorded: Sequence[RecordedDemonstration], others: Sequence[RecordedDemonstration], scene: SceneView
) -> Case:
    """The case in which nothing is wrong."""
    return Case(
        tuple(map(recording_of, recorded)),
        scene.instruction,
        scene.objects,
        {"yaw_symmetry_deg": dict(world.tasks[scene.task]), "num_demonstrations": len(recorded)},
        {"model": "nearest", "max_actions": 100},  # an instruction may have six parts
        tuple(map(recording_of, others)),
        scene.end_effector,
    )
