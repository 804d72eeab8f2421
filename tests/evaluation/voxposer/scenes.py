"""A small scene for programs: two objects on a table, the gripper above them."""

import numpy as np

from app.evaluation.voxposer.sandbox import Scene
from app.pipeline.workspace import Workspace
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

DOWN_XYZW = np.array([1.0, 0.0, 0.0, 0.0])
START = EndEffectorAction(np.array([0.0, 0.0, 1.2]), DOWN_XYZW, gripper_open=True)
QUARTER_XYZW = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
CUBE_M, BOX_M = np.array([0.203, 0.104, 0.801]), np.array([0.305, -0.205, 0.855])


OBJECTS = (ObjectPose("cube", CUBE_M, None), ObjectPose("box", BOX_M, QUARTER_XYZW))
SCENE = Scene(Workspace.rlbench(), OBJECTS, 0.02, START)
GO = "target = empty_affordance_map()\nset_voxels(target, detect('cube'))\nmove(target)\n"
