"""The drawer tasks: `open_drawer` opens the bottom drawer, `put_in_drawer` also puts a block into it.

They share a cabinet of three drawers, and how its bottom drawer is opened. The block lies on top of the cabinet.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.moves import UP, Move, move_to, pick, place, tool_down
from app.sim.scene import BOARD_M, SceneBody, about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

DRAWERS = ("bottom", "middle", "top")
HALF_DEPTH_M, HALF_WIDTH_M, STOREY_M = 0.10, 0.12, 0.085
FEET_M = 0.02
# The handle: a vertical bar in front of the drawer; its center is the origin of the drawer's body
HANDLE_HALF_M = (0.014, 0.009, 0.022)
HANDLE_FROM_FRONT_M = 0.020
HANDLE_HEIGHT_M = 0.046  # above the middle of the cabinet's board
TOP_ABOVE_HANDLE_M = len(DRAWERS) * STOREY_M + BOARD_M / 2 - HANDLE_HEIGHT_M  # of the cabinet, above the bottom handle
TRAVEL_M = 0.18
PULL_M = 0.175  # two bins (2 cm) less still open it far enough
TILT_RAD = 0.60  # of the tool: keeps the hand clear of the upper drawers; more forces the elbow out
APPROACH_M, RETREAT_M = 0.12, 0.06
RISES_M = (0.06, 0.11)  # by way: of the approach, above the handle
FACING_RAD = np.radians(-70.0)
MAX_TURN_RAD = np.pi / 8  # RLBench: within 22.5 degrees
OPEN_M = 0.15  # RLBench's condition on the drawer's joint
HALF_SIZE_M = 0.020
# Where the block lies on the cabinet, behind the handle and beside it; further back the arm would not reach over it
LOW_M, HIGH_M = (0.045, -0.06), (0.110, 0.06)
CLEARANCE_M = 0.08
RISE_M = 0.30  # over the open drawer, before and after: as high as over the block
# Where the gripper opens: in the open drawer's front part, clear of the drawers above; and its height
BEHIND_HANDLE_M, DROP_HEIGHT_M = 0.075, 0.005
INSIDE_HALF_HEIGHT_M = 0.025  # of the drawer, about the handle's center: from its floor to its front's upper edge


class DrawerTask(SimTask):
    """A cabinet of three drawers to the robot's right, turned by up to 22.5 degrees either way as in RLBench.

    The bottom handle lies in x 0.16..0.30 m, y -0.28..-0.10 m. The drawer's pose is its handle's center; x points into
    the cabinet, so that the drawer opens along -x.
    """

    ways = len(RISES_M)

    def add_cabinet(self, random: np.random.Generator) -> tuple[Array, Rotation]:
        """The cabinet, for use in `build`; returns the bottom handle's center (3,) and the cabinet's turn."""
        turn = about_z(FACING_RAD + random.uniform(-MAX_TURN_RAD, MAX_TURN_RAD))
        handle = np.array([*random.uniform((0.16, -0.28), (0.30, -0.10)), TABLE_TOP_M + FEET_M + HANDLE_HEIGHT_M])
        foot = turn.apply([HALF_DEPTH_M + HANDLE_FROM_FRONT_M, 0, -HANDLE_HEIGHT_M])
        cabinet = self.add_part("cabinet", handle + foot, turn)
        _add_boards(cabinet)
        for storey, which in enumerate(DRAWERS):
            handle_m = [-HALF_DEPTH_M - HANDLE_FROM_FRONT_M, 0, storey * STOREY_M + HANDLE_HEIGHT_M]
            drawer = self.add_part(f"{which} drawer", handle_m, parent=cabinet)
            _add_drawer(drawer)
            drawer.slide(which, (-1, 0, 0), (0, TRAVEL_M), damping=4.0, dry_friction_n=0.8)
        return handle, turn

    def open_bottom_drawer(self) -> list[Move]:
        """Pull the bottom drawer out by its handle, let go and withdraw the hand."""
        handle = self.position_m("bottom drawer")
        tool = tool_down(self.yaw_rad("bottom drawer"), TILT_RAD)
        approach, out = tool.apply(UP), self.rotation("bottom drawer").apply([-1, 0, 0])
        pulled = handle + PULL_M * out
        return [
            move_to(handle + APPROACH_M * out + RISES_M[self.way] * UP, tool, gripper_open=True, straight=False),
            move_to(handle, tool, gripper_open=False),
            move_to(pulled, tool, gripper_open=True),
            move_to(pulled - RETREAT_M * approach, tool, gripper_open=True),
        ]


def _add_boards(cabinet: SceneBody) -> None:
    heights_m = [storey * STOREY_M for storey in range(len(DRAWERS) + 1)]
    front_m = (-HALF_DEPTH_M, 0, BOARD_M / 2)
    cabinet.case("wood", heights_m, depth_m=2 * HALF_DEPTH_M, half_width_m=HALF_WIDTH_M, front_m=front_m)
    cabinet.box((HALF_DEPTH_M - 0.01, HALF_WIDTH_M - 0.01, FEET_M / 2), "black", at_m=[0, 0, -FEET_M / 2])


def _add_drawer(drawer: SceneBody) -> None:
    """Around the handle's center, a little smaller than the cabinet's storey."""
    front, back = HANDLE_FROM_FRONT_M + 0.001, HANDLE_FROM_FRONT_M + 2 * HALF_DEPTH_M - 0.012
    half_width, floor = HALF_WIDTH_M - 0.010, 0.012 - HANDLE_HEIGHT_M
    middle, half_length = (front + back) / 2, (back - front) / 2
    drawer.box(HANDLE_HALF_M, "black", mass_kg=0.03)
    drawer.box((0.004, half_width, 0.030), "white", at_m=[front, 0, -0.004], mass_kg=0.1)
    drawer.box((0.004, half_width, 0.025), "white", at_m=[back, 0, -0.009], mass_kg=0.05)
    drawer.box((half_length, half_width, 0.003), "white", at_m=[middle, 0, floor], mass_kg=0.2)
    for y_m in (-half_width + 0.004, half_width - 0.004):
        drawer.box((half_length, 0.003, 0.025), "white", at_m=[middle, y_m, -0.009], mass_kg=0.05)


class OpenDrawer(DrawerTask):
    """Success: the bottom drawer is open by 15 cm (of 18)."""

    name = "open_drawer"
    object_names = ("bottom drawer",)
    instruction = "open the bottom drawer"

    def build(self, random: np.random.Generator) -> None:
        self.add_cabinet(random)

    def expert(self) -> list[Move]:
        return self.open_bottom_drawer()

    def succeeded(self) -> bool:
        return self.joint_position("bottom") > OPEN_M


class PutInDrawer(DrawerTask):
    """The closed cabinet of `open_drawer`, and a block on top of it.

    The block lies 4.5..11 cm behind the bottom handle and up to 6 cm to its sides, turned at random. Its pose is its
    center. Success: the block is inside the bottom drawer and the gripper holds nothing.
    """

    name = "put_in_drawer"
    object_names = ("block", "bottom drawer")
    yaw_symmetry_deg = dict.fromkeys(("block",), 90.0)
    instruction = "put the block in the bottom drawer"

    def build(self, random: np.random.Generator) -> None:
        handle, turn = self.add_cabinet(random)
        at_m = [*random.uniform(LOW_M, HIGH_M), TOP_ABOVE_HANDLE_M + HALF_SIZE_M]
        yaw_rad = random.uniform(-np.pi, np.pi)
        self.add_cube("block", "red", handle + turn.apply(at_m), HALF_SIZE_M, yaw_rad, mass_kg=0.05)

    def expert(self) -> list[Move]:
        drop_m = self.body_to_world("bottom drawer", [BEHIND_HANDLE_M - PULL_M, 0, DROP_HEIGHT_M])
        release = self.tool_over("bottom drawer")
        return [
            *self.open_bottom_drawer(),
            move_to(drop_m + RISE_M * UP, release, gripper_open=True),
            *pick(*self.grasp("block"), CLEARANCE_M, straight=True),
            *place(drop_m, release, RISE_M, straight=True),
        ]

    def succeeded(self) -> bool:
        x, y, z = self.world_to_body("bottom drawer", self.position_m("block"))
        behind_front = 0 < x - HANDLE_FROM_FRONT_M < 2 * HALF_DEPTH_M
        inside = behind_front and abs(y) < HALF_WIDTH_M and abs(z) < INSIDE_HALF_HEIGHT_M
        return bool(inside) and self.gripper_holds_nothing()
