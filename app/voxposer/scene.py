"""What a program is about: the workspace, the objects' points in the first image, and where the end effector is."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from app.pipeline.workspace import Workspace
from app.voxposer.program.voxels import SIZE, Voxels
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

MAX_VOXELS = 400  # of an object that a program may see one by one


def voxels_of(workspace: Workspace) -> Voxels:
    """The workspace cut into SIZE voxels along each axis."""
    step_m = (workspace.max_m - workspace.min_m) / SIZE
    return Voxels(tuple(workspace.min_m.tolist()), tuple(step_m.tolist()))


@dataclass(frozen=True, eq=False)
class SeenObject:
    """An object as perception has it.

    Attributes:
        pose: in the world frame.
        points_m: (N, 3) points of it in the world frame, at least one.
    """

    pose: ObjectPose
    points_m: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """The world before the first move.

    Attributes:
        start: the end effector's pose and the gripper's state.
    """

    workspace: Workspace
    objects: tuple[SeenObject, ...]
    start: EndEffectorAction

    def to_json(self) -> dict[str, Any]:
        """As the program's process reads it."""
        voxels = voxels_of(self.workspace)
        start = ObjectPose("hand", self.start.position_m, self.start.quaternion_xyzw)
        return {
            "min_m": voxels.min_m,
            "step_m": voxels.step_m,
            "objects": [_json_of(item.pose, item.points_m, voxels) for item in self.objects],
            "hand": _json_of(start, self.start.position_m[None], voxels),
        }


def _json_of(pose: ObjectPose, points_m: Array, voxels: Voxels) -> dict[str, Any]:
    held = np.unique([voxels.at(point) for point in points_m.tolist()], axis=0)
    step = -(-len(held) // MAX_VOXELS)
    return {
        "name": pose.name,
        "position_m": pose.position_m.tolist(),
        "quaternion_xyzw": None if pose.quaternion_xyzw is None else pose.quaternion_xyzw.tolist(),
        "voxels": held[::step].tolist(),
    }
