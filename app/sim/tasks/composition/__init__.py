"""Tasks that copying a demonstration cannot solve, because words or scene ask for a combination that none shows.

They are a yardstick for language models, beside the tasks of the paper.
"""

from app.sim.tasks.composition.build_tower import BuildTower
from app.sim.tasks.composition.clear_kind import ClearKind
from app.sim.tasks.composition.place_beside import PlaceBeside
from app.sim.tasks.composition.press_in_order import PressInOrder
from app.sim.tasks.composition.swap_cubes import SwapCubes
from app.sim.tasks.composition.way_round import WayRound

COMPOSITIONS = (BuildTower, PressInOrder, SwapCubes, PlaceBeside, ClearKind, WayRound)
