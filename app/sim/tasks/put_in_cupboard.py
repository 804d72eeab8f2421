"""Put the crackers, of several groceries, in a cupboard."""

import numpy as np

from app.sim.moves import Move, move_to, nearest_yaw_rad, pick, tool_down
from app.sim.scene import Part, about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.tasks.cases import BOARD_M, add_case
from app.sim.world import TABLE_TOP_M

CRACKERS_HALF_M = (0.025, 0.020, 0.055)
CRACKERS_KG = 0.12
CANS = {"soup": "blue", "mustard": "yellow"}
CAN_RADIUS_M, CAN_HALF_HEIGHT_M, CAN_KG = 0.025, 0.03, 0.1
MIN_DISTANCE_M = 0.09
STAND_M = 0.10  # from the table to the lower shelf
DEPTH_M, HALF_WIDTH_M = 0.20, 0.15
SHELVES_M = (0.0, 0.23)  # above the lower shelf
TOP_M = 0.36
TILT_RAD = 0.70  # of the tool, for grasp and release alike: keeps the hand clear of the shelf above
GRASP_AT_M = (-0.010, 0.0, 0.040)  # in the crackers' axes; near their top, where they stay clear of the tilted palm
CLEARANCE_M = 0.12
INSIDE_M = 0.035  # how far behind the shelf's edge the gripper opens; further in, the wrist would touch the shelf above
DROP_M = 0.010
BACK_M, RISE_M = 0.18, 0.04  # from where the gripper opens to before and after
CUPBOARD_LOW_M, CUPBOARD_HIGH_M = (0.32, -0.26), (0.40, -0.16)
CUPBOARD_YAW_RAD = np.radians((-75.0, 39.0))
CRACKERS_YAW_RAD = np.radians((-25.0, 65.0))
GROCERIES_LOW_M, GROCERIES_HIGH_M = (0.16, 0.12), (0.32, 0.34)


class PutInCupboard(SimTask):
    """Crackers and two cans on the table to the robot's left and a raised cupboard of two shelves to its right.

    The cupboard's front edge has its middle in x 0.32..0.40 m, y -0.26..-0.16 m; its yaw is -75..39 degrees, a range of
    57 either way as in RLBench. The groceries stand at least 9 cm apart in x 0.16..0.32 m, y 0.12..0.34 m, the crackers
    at a yaw of -25..65 degrees (RLBench: any; at others the arm sometimes runs into the other groceries or the
    cupboard's side). The crackers' pose is their centre, x along their broad side. The cupboard's is the middle of the
    lower shelf's front edge, on the shelf; x points inside. Success: the crackers are above the lower shelf and below
    the next, and the gripper holds nothing.
    """

    name = "put_in_cupboard"
    object_names = ("crackers", "cupboard")
    yaw_symmetry_deg = dict.fromkeys(("crackers",), 180.0)

    def build(self, random: np.random.Generator) -> None:
        edge, yaw_rad = random.uniform(CUPBOARD_LOW_M, CUPBOARD_HIGH_M), random.uniform(*CUPBOARD_YAW_RAD)
        _add_boards(self.add_part("cupboard", [*edge, TABLE_TOP_M + STAND_M], about_z(yaw_rad)))
        spot, *others = scatter(random, 1 + len(CANS), GROCERIES_LOW_M, GROCERIES_HIGH_M, MIN_DISTANCE_M)
        turn = about_z(random.uniform(*CRACKERS_YAW_RAD))
        crackers = self.add_part("crackers", [*spot, TABLE_TOP_M + CRACKERS_HALF_M[2]], turn, free=True)
        crackers.box(CRACKERS_HALF_M, "red", mass_kg=CRACKERS_KG)
        for (name, colour), spot in zip(CANS.items(), others, strict=True):
            can = self.add_part(name, [*spot, TABLE_TOP_M + CAN_HALF_HEIGHT_M], free=True)
            can.cylinder(CAN_RADIUS_M, CAN_HALF_HEIGHT_M, colour, mass_kg=CAN_KG)

    @property
    def instruction(self) -> str:
        return "put the crackers in the cupboard"

    def expert(self) -> list[Move]:
        yaw_rad = nearest_yaw_rad(self.yaw_rad("crackers"))
        grasp_m = self.position_m("crackers") + about_z(yaw_rad).apply(GRASP_AT_M)
        into, release = self.rotation("cupboard"), tool_down(self.yaw_rad("cupboard"), TILT_RAD)
        inside = self.position_m("cupboard") + into.apply([INSIDE_M, 0, CRACKERS_HALF_M[2] + GRASP_AT_M[2] + DROP_M])
        before = inside + into.apply([-BACK_M, 0, RISE_M])
        return [
            *pick(grasp_m, tool_down(yaw_rad, TILT_RAD), CLEARANCE_M),
            move_to(before, release, gripper_open=False),
            move_to(inside, release, gripper_open=True),
            move_to(before, release, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        x, y, z = self.rotation("cupboard").inv().apply(self.position_m("crackers") - self.position_m("cupboard"))
        inside = 0 < x < DEPTH_M and abs(y) < HALF_WIDTH_M and 0 < z < SHELVES_M[1]
        return bool(inside) and self.gripper_holds_nothing()


def _add_boards(cupboard: Part) -> None:
    add_case(cupboard, "wood", (*SHELVES_M, TOP_M), depth_m=DEPTH_M, half_width_m=HALF_WIDTH_M)
    stand_half_m = (DEPTH_M / 2 - 0.01, HALF_WIDTH_M - 0.01, (STAND_M - BOARD_M) / 2)
    cupboard.box(stand_half_m, "black", at_m=[DEPTH_M / 2 + 0.01, 0, -BOARD_M - stand_half_m[2]])
