"""Open the bottom drawer of a cabinet."""

import numpy as np

from app.sim.moves import Move
from app.sim.tasks.cabinet import DrawerTask

OPEN_M = 0.15  # RLBench's condition on the drawer's joint


class OpenDrawer(DrawerTask):
    """Success: the bottom drawer is open by 15 cm (of 18)."""

    name = "open_drawer"
    object_names = ("bottom drawer",)

    def build(self, random: np.random.Generator) -> None:
        self.add_cabinet(random)

    @property
    def instruction(self) -> str:
        return "open the bottom drawer"

    def expert(self) -> list[Move]:
        return self.open_bottom_drawer()

    def succeeded(self) -> bool:
        return self.joint_position("bottom") > OPEN_M
