"""The planner of the baseline after VoxPoser, with programs that people wrote; runs in a worker."""

import numpy as np

from app.evaluation.oracle_programs import PROGRAMS, oracle_program
from app.pipeline.workspace import Workspace
from app.sim.demonstrate import SceneView
from app.voxposer.errors import ProgramRefusedError
from app.voxposer.plan import plan_moves
from app.voxposer.sandbox import run_program
from app.voxposer.scene import Scene, SeenObject
from roboprompt_client.trajectory import EndEffectorAction

MAX_ACTIONS = 100


def oracle_actions(view: SceneView) -> tuple[EndEffectorAction, ...]:
    """What the planner makes of the task's program in a scene; of each object it knows the pose, and no more.

    Raises:
        ProgramRefusedError: if the task has no program, or it is refused.
    """
    if view.task not in PROGRAMS:
        raise ProgramRefusedError(f"nobody has written a program for {view.task} (valid: {', '.join(PROGRAMS)})")
    assert view.end_effector is not None
    start = EndEffectorAction(
        np.array(view.end_effector.position_m), np.array(view.end_effector.quaternion_xyzw), gripper_open=True
    )
    objects = tuple(SeenObject(pose, pose.position_m[None]) for pose in view.objects)
    scene = Scene(Workspace.rlbench(), objects, start)
    program = oracle_program(view.task, view.instruction, [pose.name for pose in view.objects])
    return plan_moves(run_program(program, scene), scene, MAX_ACTIONS).actions
