"""A small scene for programs: two objects on a table, the gripper above them."""

import numpy as np

from app.evaluation.baselines.voxposer.sandbox import Scene, SeenObject
from app.pipeline.workspace import Workspace
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

DOWN_XYZW = np.array([1.0, 0.0, 0.0, 0.0])
START = EndEffectorAction(np.array([0.0, 0.0, 1.2]), DOWN_XYZW, gripper_open=True)
QUARTER_XYZW = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
CUBE_M, BOX_M = np.array([0.203, 0.104, 0.801]), np.array([0.305, -0.205, 0.855])


def seen(name, position_m, quaternion_xyzw=None):
    corners = np.array(np.meshgrid(*[[-0.02, 0.02]] * 3)).reshape(3, -1).T
    return SeenObject(ObjectPose(name, position_m, quaternion_xyzw), position_m + corners)


SCENE = Scene(Workspace.rlbench(), (seen("cube", CUBE_M), seen("box", BOX_M, QUARTER_XYZW)), START)
GO = "target = empty_affordance_map()\nset_voxels(target, detect('cube'))\nmove(target)\n"
