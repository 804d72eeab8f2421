"""Open the bottom drawer of a cabinet and put the block into it that lies on top."""

import numpy as np

from app.sim.moves import UP, Move, move_to, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import about_z
from app.sim.tasks.cabinet import (
    HALF_DEPTH_M,
    HALF_WIDTH_M,
    HANDLE_FROM_FRONT_M,
    PULL_M,
    TOP_ABOVE_HANDLE_M,
    DrawerTask,
)

HALF_SIZE_M = 0.020
MASS_KG = 0.05
# Where the block lies on the cabinet, behind the handle and beside it; further back the arm would not reach over it
LOW_M, HIGH_M = (0.045, -0.06), (0.110, 0.06)
CLEARANCE_M = 0.08
RISE_M = 0.30  # over the open drawer, before and after: as high as over the block
# Where the gripper opens: in the open drawer's front part, clear of the drawers above; and its height
BEHIND_HANDLE_M, DROP_HEIGHT_M = 0.075, 0.005
INSIDE_HALF_HEIGHT_M = 0.025  # of the drawer, about the handle's centre: from its floor to its front's upper edge


class PutInDrawer(DrawerTask):
    """The closed cabinet of `open_drawer`, and a block on top of it.

    The block lies 4.5..11 cm behind the bottom handle and up to 6 cm to its sides, turned at random. Its pose is its
    centre. Success: the block is inside the bottom drawer and the gripper holds nothing.
    """

    name = "put_in_drawer"
    object_names = ("block", "bottom drawer")
    yaw_symmetry_deg = dict.fromkeys(("block",), 90.0)

    def build(self, random: np.random.Generator) -> None:
        handle, turn = self.add_cabinet(random)
        at_m = [*random.uniform(LOW_M, HIGH_M), TOP_ABOVE_HANDLE_M + HALF_SIZE_M]
        block = self.add_part("block", handle + turn.apply(at_m), about_z(random.uniform(-np.pi, np.pi)), free=True)
        block.box((HALF_SIZE_M,) * 3, "red", mass_kg=MASS_KG)

    @property
    def instruction(self) -> str:
        return "put the block in the bottom drawer"

    def expert(self) -> list[Move]:
        drawer, into = self.position_m("bottom drawer"), self.rotation("bottom drawer")
        drop_m = drawer + into.apply([BEHIND_HANDLE_M - PULL_M, 0, DROP_HEIGHT_M])
        release = tool_down(self.yaw_rad("bottom drawer"))
        grasp = tool_down(nearest_yaw_rad(self.yaw_rad("block"), np.pi / 2))
        return [
            *self.open_bottom_drawer(),
            move_to(drop_m + RISE_M * UP, release, gripper_open=True),
            *pick(self.position_m("block"), grasp, CLEARANCE_M, straight=True),
            *place(drop_m, release, RISE_M, straight=True),
        ]

    def succeeded(self) -> bool:
        to_drawer = self.rotation("bottom drawer").inv()
        x, y, z = to_drawer.apply(self.position_m("block") - self.position_m("bottom drawer"))
        behind_front = 0 < x - HANDLE_FROM_FRONT_M < 2 * HALF_DEPTH_M
        inside = behind_front and abs(y) < HALF_WIDTH_M and abs(z) < INSIDE_HALF_HEIGHT_M
        return bool(inside) and self.gripper_holds_nothing()
