"""Where objects are while a motion goes on: what the hand grasps moves with it until it lets go."""

from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.thresholds import GRASPED_M
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

Objects = tuple[ObjectPose, ...]


@dataclass(frozen=True, eq=False)
class SceneState:
    """A scene between two actions.

    Attributes:
        objects: where they are. What the hand has put down counts as moved from the hand's next grasp on: the retreat
            from it still belongs to the place where it was put.
        hand: the last action; None before the first.
        held: the object in the hand, and the hand's pose when it grasped it.
        put_down: the object that the hand has put down since its last grasp, at its new pose.
    """

    objects: Objects
    hand: EndEffectorAction | None = None
    held: tuple[ObjectPose, EndEffectorAction] | None = None
    put_down: ObjectPose | None = None

    def after(self, action: EndEffectorAction) -> "SceneState":
        """Return the scene after a further action."""
        was_open = self.hand is not None and self.hand.gripper_open
        if was_open and not action.gripper_open:
            objects = self._with_put_down()
            return SceneState(objects, action, _grasped(objects, action))
        if self.held is not None and action.gripper_open:
            return SceneState(self.objects, action, put_down=_moved(*self.held, action))
        return replace(self, hand=action)

    def _with_put_down(self) -> Objects:
        moved = self.put_down
        return self.objects if moved is None else tuple(moved if o.name == moved.name else o for o in self.objects)


def scenes_before(demonstration: Demonstration) -> list[SceneState]:
    """Return the scene before each action."""
    return list(accumulate(demonstration.actions[:-1], SceneState.after, initial=SceneState(demonstration.objects)))


def _grasped(objects: Objects, hand: EndEffectorAction) -> tuple[ObjectPose, EndEffectorAction] | None:
    nearest = min(objects, key=lambda pose: float(np.linalg.norm(pose.position_m - hand.position_m)), default=None)
    if nearest is None or np.linalg.norm(nearest.position_m - hand.position_m) > GRASPED_M:
        return None
    return nearest, hand


def _moved(pose: ObjectPose, grasp: EndEffectorAction, release: EndEffectorAction) -> ObjectPose:
    """Return the pose of an object that the hand has moved from where it grasped it to where it let go."""
    turn = Rotation.from_quat(release.quaternion_xyzw) * Rotation.from_quat(grasp.quaternion_xyzw).inv()
    position_m = release.position_m + turn.apply(pose.position_m - grasp.position_m)
    turned = None if pose.quaternion_xyzw is None else (turn * Rotation.from_quat(pose.quaternion_xyzw)).as_quat()
    return ObjectPose(pose.name, position_m, turned)
