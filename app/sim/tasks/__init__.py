"""The tasks, by name."""

from collections.abc import Mapping

from app.pipeline.errors import InvalidInputError
from app.sim.tasks.base import SimTask
from app.sim.tasks.open_drawer import OpenDrawer
from app.sim.tasks.push_button import PushButton
from app.sim.tasks.stack_cube import StackCube

TASKS: Mapping[str, type[SimTask]] = {task.name: task for task in (PushButton, StackCube, OpenDrawer)}


def make_task(name: str, seed: int, variation: int | None = None) -> SimTask:
    """A scene of the task `name`, the arm at home; see SimTask for seed and variation.

    Raises:
        InvalidInputError: if there is no such task or variation, naming those there are.
    """
    if name not in TASKS:
        raise InvalidInputError("task", f"{name!r} is not simulated", ", ".join(TASKS))
    task = TASKS[name]
    if variation is not None and not 0 <= variation < task.variations:
        raise InvalidInputError("variation", f"{name} has no variation {variation}", f"0..{task.variations - 1}")
    return task(seed, variation)
