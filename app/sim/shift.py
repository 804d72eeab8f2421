"""Disturb a scene after the robot has observed it: move its free objects aside."""

import mujoco
import numpy as np
from scipy.sparse.csgraph import connected_components

from app.sim.tasks import ALL_TASKS
from app.sim.tasks.base import SETTLE_S, SimTask
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array

TRIALS = 60
DEEPEST_M = 0.0005  # solids that rest on each other sink in by less
SLIP_M, SLIP_DEG = 0.005, 5.0  # what has moved on by more when it has settled fell or was pushed away


def free_objects(task: SimTask) -> tuple[str, ...]:
    """The named objects that lie free in the scene; drawers, buttons and the like are fixed to it."""
    return tuple(name for name in task.object_names if _is_free(task, task.model.body(name).id))


def can_shift(task_name: str, distance_m: float) -> bool:
    """Whether a task's scene has free objects, and room to move them."""
    try:
        return bool(shift_free_objects(ALL_TASKS[task_name](0), distance_m, 0))
    except InvalidInputError:
        return False


def shift_free_objects(task: SimTask, distance_m: float, seed: int) -> tuple[str, ...]:
    """Move every free object by `distance_m` in a horizontal direction of its own; the names of those moved.

    Objects that touch each other move together, so that stacks stay stacks. Directions in which one would run into
    something, or would not stay where it is put, are drawn again.

    Raises:
        InvalidInputError: if the scene has no free object, or no room to move them.
    """
    names = free_objects(task)
    if not names:
        raise InvalidInputError("shift", f"the scene of {task.name} has no free object", "tasks with free objects")
    random = np.random.default_rng(seed)
    groups = _groups(task, [task.model.body(name).id for name in names])
    saved = mujoco.MjData(task.model)
    mujoco.mj_copyData(saved, task.model, task.data)
    for _ in range(TRIALS):
        angles_rad = random.uniform(-np.pi, np.pi, len(groups))
        shifts_m = [distance_m * np.array([np.cos(angle), np.sin(angle), 0.0]) for angle in angles_rad]
        if _try(task, list(zip(groups, shifts_m, strict=True))):
            return names
        mujoco.mj_copyData(task.data, task.model, saved)
    message = f"the scene of {task.name} has no room to move its objects by {distance_m:g} m"
    raise InvalidInputError("shift", message, "a smaller one, or tasks whose objects stand free")


def _try(task: SimTask, moves: list[tuple[list[int], Array]]) -> bool:
    """Move groups of bodies and let the scene settle; whether everything lies where it was put."""
    model, data = task.model, task.data
    wanted = {body: (data.xpos[body] + shift_m, task.rotation(body)) for group, shift_m in moves for body in group}
    for body, (position_m, _) in wanted.items():
        data.qpos[model.jnt_qposadr[model.body_jntadr[body]] :][:3] += position_m - data.xpos[body]
    mujoco.mj_forward(model, data)
    if any(contact.dist < -DEEPEST_M for contact in data.contact):
        return False
    time_s = data.time
    mujoco.mj_step(model, data, round(SETTLE_S / model.opt.timestep))
    data.time = time_s
    return all(
        float(np.linalg.norm(data.xpos[body] - position_m)) < SLIP_M
        and np.degrees((task.rotation(body).inv() * rotation).magnitude()) < SLIP_DEG
        for body, (position_m, rotation) in wanted.items()
    )


def _groups(task: SimTask, bodies: list[int]) -> list[list[int]]:
    """Return the bodies with every free body that touches them, directly or through others: one list for each group."""
    model, touching = task.model, np.zeros((task.model.nbody, task.model.nbody))
    for one, other in model.geom_bodyid[task.data.contact.geom[: task.data.ncon]]:
        touching[one, other] = _is_free(task, one) and _is_free(task, other)
    _, group = connected_components(touching, directed=False)
    return [np.flatnonzero(group == number).tolist() for number in dict.fromkeys(group[bodies].tolist())]


def _is_free(task: SimTask, body: int) -> bool:
    joint = task.model.body_jntadr[body]
    return bool(joint >= 0 and task.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE)
