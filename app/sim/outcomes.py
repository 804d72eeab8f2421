"""Scenes as they are observed, recorded demonstrations, and results of rollouts. Imports no simulator."""

from dataclasses import dataclass

from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class SceneView:
    """A scene as it is observed before the arm moves.

    Attributes:
        objects: true poses.
        frames: one per camera; empty if no images were asked for.
        mask_ids: for each object the ids of its pixels in the frames' masks.
        end_effector: its pose; None where it was not observed.
    """

    task: str
    seed: int
    instruction: str
    objects: tuple[ObjectPose, ...]
    frames: tuple[RgbdFrame, ...]
    mask_ids: dict[str, tuple[int, ...]]
    end_effector: Pose | None = None


@dataclass(frozen=True, eq=False)
class RecordedDemonstration:
    """An expert's solution of a scene.

    Attributes:
        succeeded: whether the scene was solved in the end.
        failure: why it was not; empty if it was.
        expert_actions: the poses that the expert chose, and what the gripper then does; where it rested, the keyframe
            rule `merged` finds as many.
    """

    scene: SceneView
    trajectory: Trajectory
    control_frequency_hz: float
    succeeded: bool
    failure: str
    expert_actions: tuple[EndEffectorAction, ...] = ()


@dataclass(frozen=True, eq=False)
class RolloutResult:
    """The result of carrying out predicted actions.

    Attributes:
        num_executed: actions that were carried out.
        succeeded, failure: as in RecordedDemonstration.
    """

    num_executed: int
    succeeded: bool
    failure: str
