"""The tasks, by name: those of the paper, and beside them those of compositions.

Compositions cannot be solved by copying a demonstration, because words or scene ask for a combination that none shows:
a yardstick for language models. Every part of a plan is demonstrated (`SHOWN`), some combinations are not (`ASKED`).
"""

from collections.abc import Mapping

from app.sim.tasks.base import SimTask
from app.sim.tasks.buttons import PressInOrder, PushButton, PushMultipleButtons
from app.sim.tasks.carrying import WayRound
from app.sim.tasks.cubes import BuildTower, DestackCube, StackBlocks, StackCube
from app.sim.tasks.cups import PlaceCups, StackCups
from app.sim.tasks.fitting import CloseJar, ScrewBulb, SortShape
from app.sim.tasks.furniture import OpenDrawer, PutInCupboard, PutInDrawer, PutInSafe
from app.sim.tasks.kitchen import MeatOffGrill, PlaceWine, TurnTap
from app.sim.tasks.laptop import CloseLaptop, UnplugCable
from app.sim.tasks.pushing import SlideBlock, SweepToDustpan
from app.sim.tasks.rearranging import ClearKind, PlaceBeside, SwapCubes
from roboprompt_client.errors import InvalidInputError

TASKS: Mapping[str, type[SimTask]] = {
    task.name: task
    for task in (
        PushButton,
        StackCube,
        OpenDrawer,
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
COMPOSITION_TASKS: Mapping[str, type[SimTask]] = {
    task.name: task for task in (BuildTower, PressInOrder, SwapCubes, PlaceBeside, ClearKind, WayRound)
}
ALL_TASKS: Mapping[str, type[SimTask]] = {**TASKS, **COMPOSITION_TASKS}


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
