"""The tasks, by name: those of the paper, and beside them those of compositions and those that move."""

from collections.abc import Mapping

from app.sim.tasks.base import SimTask
from app.sim.tasks.buttons import PushButton, PushButtonReal, PushMultipleButtons
from app.sim.tasks.close_jar import CloseJar
from app.sim.tasks.close_laptop import CloseLaptop
from app.sim.tasks.composition import COMPOSITIONS
from app.sim.tasks.cubes import DestackCube, StackCube
from app.sim.tasks.drawers import OpenDrawer, PutInDrawer
from app.sim.tasks.meat_off_grill import MeatOffGrill
from app.sim.tasks.moving import MOVING
from app.sim.tasks.place_cups import PlaceCups
from app.sim.tasks.place_wine import PlaceWine
from app.sim.tasks.put_in_cupboard import PutInCupboard
from app.sim.tasks.put_in_safe import PutInSafe
from app.sim.tasks.screw_bulb import ScrewBulb
from app.sim.tasks.slide_block import SlideBlock
from app.sim.tasks.sort_shape import SortShape
from app.sim.tasks.stack_blocks import StackBlocks
from app.sim.tasks.stack_cups import StackCups
from app.sim.tasks.sweep_to_dustpan import SweepToDustpan
from app.sim.tasks.turn_tap import TurnTap
from app.sim.tasks.unplug_cable import UnplugCable
from roboprompt_client.errors import InvalidInputError

TASKS: Mapping[str, type[SimTask]] = {
    task.name: task
    for task in (
        PushButton,
        StackCube,
        OpenDrawer,
        PushButtonReal,
        PushMultipleButtons,
        DestackCube,
        CloseJar,
        StackBlocks,
        ScrewBulb,
        MeatOffGrill,
        StackCups,
        SortShape,
        CloseLaptop,
        UnplugCable,
        SlideBlock,
        TurnTap,
        PutInSafe,
        SweepToDustpan,
        PlaceCups,
        PlaceWine,
        PutInDrawer,
        PutInCupboard,
    )
}
COMPOSITION_TASKS: Mapping[str, type[SimTask]] = {task.name: task for task in COMPOSITIONS}
MOVING_TASKS: Mapping[str, type[SimTask]] = {task.name: task for task in MOVING}
ALL_TASKS: Mapping[str, type[SimTask]] = {**TASKS, **COMPOSITION_TASKS, **MOVING_TASKS}


def make_task(name: str, seed: int, variation: int | None = None) -> SimTask:
    """A scene of the task `name`, the arm at home; see SimTask for seed and variation.

    Raises:
        InvalidInputError: if there is no such task or variation, naming those there are.
    """
    if name not in ALL_TASKS:
        raise InvalidInputError("task", f"{name!r} is not simulated", ", ".join(ALL_TASKS))
    task = ALL_TASKS[name]
    last = task.variations + task.test_only_variations - 1
    if variation is not None and not 0 <= variation <= last:
        raise InvalidInputError("variation", f"{name} has no variation {variation}", f"0..{last}")
    return task(seed, variation)
