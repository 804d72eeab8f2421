"""Cabinet, safe and cupboard: `open_drawer`, `put_in_drawer`, `put_in_safe` and `put_in_cupboard`.

The drawer tasks share a cabinet of three drawers, and how its bottom drawer is opened.
"""

from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.moves import UP, Move, move_to, pick, place, tool_down
from app.sim.scene import BOARD_M, SceneBody, Vector, about_z, scatter
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


SHELF_DEPTH_M = 0.20
SHELF_TILT_RAD = 0.70  # of the tool, for grasp and release alike: keeps the hand clear of the shelf above
SHELF_CLEARANCE_M = 0.12
INSIDE_M = 0.035  # how far behind the shelf's edge the gripper opens; further in, the wrist would touch the shelf above
DROP_M = 0.010


class ShelfTask(SimTask):
    """One object on the table and a case with shelves. Success: the object is above the lowest shelf, below the next.

    The gripper then holds nothing. The case's pose is the middle of the lowest shelf's front edge, on the shelf; x
    points inside.
    """

    stored: ClassVar[str]
    stored_half_m: ClassVar[Vector]  # half its lengths
    grasp_at_m: ClassVar[Vector]  # in the object's axes
    case: ClassVar[str]
    half_width_m: ClassVar[float]
    shelves_m: ClassVar[tuple[float, ...]]  # above the lowest shelf
    back_m: ClassVar[float]  # from where the gripper opens back to before and after, and up
    rise_m: ClassVar[float]

    def expert(self) -> list[Move]:
        yaw_rad = self.nearest_yaw_rad(self.stored)
        grasp_m = self.position_m(self.stored) + about_z(yaw_rad).apply(self.grasp_at_m)
        release = tool_down(self.yaw_rad(self.case), SHELF_TILT_RAD)
        inside = self.body_to_world(self.case, [INSIDE_M, 0, self.stored_half_m[2] + self.grasp_at_m[2] + DROP_M])
        before = inside + self.rotation(self.case).apply([-self.back_m, 0, self.rise_m])
        return [
            *pick(grasp_m, tool_down(yaw_rad, SHELF_TILT_RAD), SHELF_CLEARANCE_M),
            move_to(before, release, gripper_open=False),
            move_to(inside, release, gripper_open=True),
            move_to(before, release, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        x, y, z = self.world_to_body(self.case, self.position_m(self.stored))
        inside = 0 < x < SHELF_DEPTH_M and abs(y) < self.half_width_m and 0 < z < self.shelves_m[1]
        return bool(inside) and self.gripper_holds_nothing()


class PutInSafe(ShelfTask):
    """A bundle of money on the table to the robot's left and an open safe of three shelves to its right.

    The safe's front edge has its middle in x 0.30..0.38 m, y -0.26..-0.16 m; its yaw has a range of 90 degrees as in
    RLBench, -75..15. The money lies in x 0.20..0.32 m, y 0.12..0.30 m, turned at random: within these ranges the arm
    can go all the way from the money into the safe without changing its posture. The money's pose is its center, x
    along it.
    """

    name = "put_in_safe"
    stored, case = object_names = ("money", "safe")
    yaw_symmetry_deg = dict.fromkeys(("money",), 180.0)
    instruction = "put the money away in the safe on the bottom shelf"
    stored_half_m = (0.045, 0.022, 0.018)
    grasp_at_m = (-0.010, 0.0, 0.005)  # above its center, so that the fingertips stay off the table
    half_width_m = 0.13
    shelves_m = (0.0, 0.15, 0.26)
    back_m, rise_m = 0.16, 0.06
    top_m = 0.37
    door_rad = np.radians(240.0)  # swung open to the back, out of the arm's way

    def build(self, random: np.random.Generator) -> None:
        edge, yaw_rad = random.uniform((0.30, -0.26), (0.38, -0.16)), random.uniform(*np.radians((-75.0, 15.0)))
        safe = self.add_part("safe", [*edge, TABLE_TOP_M + BOARD_M], about_z(yaw_rad))
        safe.case("grey", (*self.shelves_m, self.top_m), depth_m=SHELF_DEPTH_M, half_width_m=self.half_width_m)
        self._add_door(safe)
        spot, yaw_rad = random.uniform((0.20, 0.12), (0.32, 0.30)), random.uniform(-np.pi, np.pi)
        money = self.add_part("money", [*spot, TABLE_TOP_M + self.stored_half_m[2]], about_z(yaw_rad), free=True)
        money.box(self.stored_half_m, "green", mass_kg=0.06)

    def _add_door(self, safe: SceneBody) -> None:
        swing = about_z(self.door_rad)
        center_m = np.array([0, -self.half_width_m, self.top_m / 2]) + swing.apply([0, self.half_width_m, 0])
        safe.box((BOARD_M / 2, self.half_width_m, self.top_m / 2), "grey", at_m=center_m, rotation=swing)


class PutInCupboard(ShelfTask):
    """Crackers and two cans on the table to the robot's left and a raised cupboard of two shelves to its right.

    The cupboard's front edge has its middle in x 0.32..0.40 m, y -0.26..-0.16 m; its yaw is -75..39 degrees, a range of
    57 either way as in RLBench. The groceries stand at least 9 cm apart in x 0.16..0.32 m, y 0.12..0.34 m, the crackers
    at a yaw of -25..65 degrees (RLBench: any; at others the arm sometimes runs into the other groceries or the
    cupboard's side). The crackers' pose is their center, x along their broad side.
    """

    name = "put_in_cupboard"
    stored, case = object_names = ("crackers", "cupboard")
    yaw_symmetry_deg = dict.fromkeys(("crackers",), 180.0)
    instruction = "put the crackers in the cupboard"
    stored_half_m = (0.025, 0.020, 0.055)
    grasp_at_m = (-0.010, 0.0, 0.040)  # near their top, where they stay clear of the tilted palm
    half_width_m = 0.15
    shelves_m = (0.0, 0.23)
    back_m, rise_m = 0.18, 0.04
    top_m = 0.36
    stand_m = 0.10  # from the table to the lower shelf
    cans: ClassVar = {"soup": "blue", "mustard": "yellow"}
    can_radius_m, can_half_height_m = 0.025, 0.03

    def build(self, random: np.random.Generator) -> None:
        edge, yaw_rad = random.uniform((0.32, -0.26), (0.40, -0.16)), random.uniform(*np.radians((-75.0, 39.0)))
        cupboard = self.add_part("cupboard", [*edge, TABLE_TOP_M + self.stand_m], about_z(yaw_rad))
        cupboard.case("wood", (*self.shelves_m, self.top_m), depth_m=SHELF_DEPTH_M, half_width_m=self.half_width_m)
        stand_half_m = (SHELF_DEPTH_M / 2 - 0.01, self.half_width_m - 0.01, (self.stand_m - BOARD_M) / 2)
        cupboard.box(stand_half_m, "black", at_m=[SHELF_DEPTH_M / 2 + 0.01, 0, -BOARD_M - stand_half_m[2]])
        spot, *others = scatter(random, 1 + len(self.cans), (0.16, 0.12), (0.32, 0.34), min_distance_m=0.09)
        turn = about_z(random.uniform(*np.radians((-25.0, 65.0))))
        crackers = self.add_part("crackers", [*spot, TABLE_TOP_M + self.stored_half_m[2]], turn, free=True)
        crackers.box(self.stored_half_m, "red", mass_kg=0.12)
        for (name, color), spot in zip(self.cans.items(), others, strict=True):
            can = self.add_part(name, [*spot, TABLE_TOP_M + self.can_half_height_m], free=True)
            can.cylinder(self.can_radius_m, self.can_half_height_m, color, mass_kg=0.1)
