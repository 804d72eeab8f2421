"""Put the money on the bottom shelf of a safe."""

import numpy as np

from app.sim.moves import Move, move_to, nearest_yaw_rad, pick, tool_down
from app.sim.scene import Part, about_z
from app.sim.tasks.base import SimTask
from app.sim.tasks.cases import BOARD_M, add_case
from app.sim.world import TABLE_TOP_M

MONEY_HALF_M = (0.045, 0.022, 0.018)
MONEY_KG = 0.06
DEPTH_M, HALF_WIDTH_M = 0.20, 0.13
SHELVES_M = (0.0, 0.15, 0.26)  # above the bottom shelf
TOP_M = 0.37
DOOR_RAD = np.radians(240.0)  # swung open to the back, out of the arm's way
TILT_RAD = 0.70  # of the tool, for grasp and release alike: keeps the hand clear of the shelf above
GRASP_AT_M = (-0.010, 0.0, 0.005)  # in the money's axes; above its centre, so that the fingertips stay off the table
CLEARANCE_M = 0.12
INSIDE_M = 0.035  # how far behind the shelf's edge the gripper opens; further in, the wrist would touch the shelf above
DROP_M = 0.010
BACK_M, RISE_M = 0.16, 0.06  # from where the gripper opens to before and after
# Within these ranges the arm can go all the way from the money into the safe without changing its posture
SAFE_LOW_M, SAFE_HIGH_M = (0.30, -0.26), (0.38, -0.16)
SAFE_YAW_RAD = np.radians((-75.0, 15.0))
MONEY_LOW_M, MONEY_HIGH_M = (0.20, 0.12), (0.32, 0.30)


class PutInSafe(SimTask):
    """A bundle of money on the table to the robot's left and an open safe of three shelves to its right.

    The safe's front edge has its middle in x 0.30..0.38 m, y -0.26..-0.16 m; its yaw has a range of 90 degrees as in
    RLBench, -75..15. The money lies in x 0.20..0.32 m, y 0.12..0.30 m, turned at random. The money's pose is its
    centre, x along it; the safe's is the middle of the bottom shelf's front edge, on the shelf, x pointing inside.
    Success: the money is above the bottom shelf and below the next, and the gripper holds nothing.
    """

    name = "put_in_safe"
    object_names = ("money", "safe")
    yaw_symmetry_deg = dict.fromkeys(("money",), 180.0)

    def build(self, random: np.random.Generator) -> None:
        edge, yaw_rad = random.uniform(SAFE_LOW_M, SAFE_HIGH_M), random.uniform(*SAFE_YAW_RAD)
        _add_case_and_door(self.add_part("safe", [*edge, TABLE_TOP_M + BOARD_M], about_z(yaw_rad)))
        spot, yaw_rad = random.uniform(MONEY_LOW_M, MONEY_HIGH_M), random.uniform(-np.pi, np.pi)
        money = self.add_part("money", [*spot, TABLE_TOP_M + MONEY_HALF_M[2]], about_z(yaw_rad), free=True)
        money.box(MONEY_HALF_M, "green", mass_kg=MONEY_KG)

    @property
    def instruction(self) -> str:
        return "put the money away in the safe on the bottom shelf"

    def expert(self) -> list[Move]:
        yaw_rad = nearest_yaw_rad(self.yaw_rad("money"))
        grasp_m = self.position_m("money") + about_z(yaw_rad).apply(GRASP_AT_M)
        into, release = self.rotation("safe"), tool_down(self.yaw_rad("safe"), TILT_RAD)
        inside = self.position_m("safe") + into.apply([INSIDE_M, 0, MONEY_HALF_M[2] + GRASP_AT_M[2] + DROP_M])
        before = inside + into.apply([-BACK_M, 0, RISE_M])
        return [
            *pick(grasp_m, tool_down(yaw_rad, TILT_RAD), CLEARANCE_M),
            move_to(before, release, gripper_open=False),
            move_to(inside, release, gripper_open=True),
            move_to(before, release, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        x, y, z = self.rotation("safe").inv().apply(self.position_m("money") - self.position_m("safe"))
        on_bottom_shelf = 0 < x < DEPTH_M and abs(y) < HALF_WIDTH_M and 0 < z < SHELVES_M[1]
        return bool(on_bottom_shelf) and self.gripper_holds_nothing()


def _add_case_and_door(safe: Part) -> None:
    add_case(safe, "grey", (*SHELVES_M, TOP_M), depth_m=DEPTH_M, half_width_m=HALF_WIDTH_M)
    swing = about_z(DOOR_RAD)
    centre_m = np.array([0, -HALF_WIDTH_M, TOP_M / 2]) + swing.apply([0, HALF_WIDTH_M, 0])
    safe.box((BOARD_M / 2, HALF_WIDTH_M, TOP_M / 2), "grey", at_m=centre_m, rotation=swing)
