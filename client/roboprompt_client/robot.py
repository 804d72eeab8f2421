"""What a robot must offer so that the service can teach it and move it."""

from dataclasses import dataclass, field
from typing import Protocol

from roboprompt_client.camera import RgbdFrame
from roboprompt_client.motion_limits import Pose
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose


@dataclass(frozen=True)
class Observation:
    """What the robot sees before it moves: poses where it knows them itself, calibrated images where it has cameras.

    Attributes:
        to_find: the names of objects that the service is to find in the images by the task's object models.
        end_effector: where the arm is: the way to the first target begins there. Needed where the task bounds steps.
    """

    objects: tuple[ObjectPose, ...] = ()
    frames: tuple[RgbdFrame, ...] = field(default=())
    to_find: tuple[str, ...] = ()
    end_effector: Pose | None = None


class Robot(Protocol):
    """An arm with a parallel gripper and calibrated cameras."""

    def observe(self) -> Observation:
        """The scene as it is now; called while the arm rests."""
        ...

    def execute(self, action: EndEffectorAction) -> None:
        """Move the end effector to the action's pose, then set the gripper; returns when both are done.

        Raises:
            MotionError: if the pose cannot be reached or the motion did not arrive.
        """
        ...

    def stop(self) -> None:
        """Hold still where the arm is; safe to call at any time."""
        ...
