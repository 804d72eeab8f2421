"""Put something on the lowest shelf of a case on the robot's right: `put_in_safe` and `put_in_cupboard`."""

from typing import ClassVar

import numpy as np

from app.sim.moves import Move, move_to, pick, tool_down
from app.sim.scene import BOARD_M, SceneBody, Vector, about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

DEPTH_M = 0.20
TILT_RAD = 0.70  # of the tool, for grasp and release alike: keeps the hand clear of the shelf above
CLEARANCE_M = 0.12
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
        release = tool_down(self.yaw_rad(self.case), TILT_RAD)
        inside = self.body_to_world(self.case, [INSIDE_M, 0, self.stored_half_m[2] + self.grasp_at_m[2] + DROP_M])
        before = inside + self.rotation(self.case).apply([-self.back_m, 0, self.rise_m])
        return [
            *pick(grasp_m, tool_down(yaw_rad, TILT_RAD), CLEARANCE_M),
            move_to(before, release, gripper_open=False),
            move_to(inside, release, gripper_open=True),
            move_to(before, release, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        x, y, z = self.world_to_body(self.case, self.position_m(self.stored))
        inside = 0 < x < DEPTH_M and abs(y) < self.half_width_m and 0 < z < self.shelves_m[1]
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
        self._add_boards(self.add_part("safe", [*edge, TABLE_TOP_M + BOARD_M], about_z(yaw_rad)))
        spot, yaw_rad = random.uniform((0.20, 0.12), (0.32, 0.30)), random.uniform(-np.pi, np.pi)
        money = self.add_part("money", [*spot, TABLE_TOP_M + self.stored_half_m[2]], about_z(yaw_rad), free=True)
        money.box(self.stored_half_m, "green", mass_kg=0.06)

    def _add_boards(self, safe: SceneBody) -> None:
        """The case and its door."""
        safe.case("grey", (*self.shelves_m, self.top_m), depth_m=DEPTH_M, half_width_m=self.half_width_m)
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
        self._add_boards(self.add_part("cupboard", [*edge, TABLE_TOP_M + self.stand_m], about_z(yaw_rad)))
        spot, *others = scatter(random, 1 + len(self.cans), (0.16, 0.12), (0.32, 0.34), min_distance_m=0.09)
        turn = about_z(random.uniform(*np.radians((-25.0, 65.0))))
        crackers = self.add_part("crackers", [*spot, TABLE_TOP_M + self.stored_half_m[2]], turn, free=True)
        crackers.box(self.stored_half_m, "red", mass_kg=0.12)
        for (name, color), spot in zip(self.cans.items(), others, strict=True):
            can = self.add_part(name, [*spot, TABLE_TOP_M + self.can_half_height_m], free=True)
            can.cylinder(self.can_radius_m, self.can_half_height_m, color, mass_kg=0.1)

    def _add_boards(self, cupboard: SceneBody) -> None:
        """The case and its stand."""
        cupboard.case("wood", (*self.shelves_m, self.top_m), depth_m=DEPTH_M, half_width_m=self.half_width_m)
        stand_half_m = (DEPTH_M / 2 - 0.01, self.half_width_m - 0.01, (self.stand_m - BOARD_M) / 2)
        cupboard.box(stand_half_m, "black", at_m=[DEPTH_M / 2 + 0.01, 0, -BOARD_M - stand_half_m[2]])
