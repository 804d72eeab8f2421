"""A block that is slid onto a square, and one that fits through a hole: `slide_block` and `sort_shape`."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from app.sim.moves import LOOSE_M, UP, Move, carry, push
from app.sim.scene import SceneBody, about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

BLOCK_HALF_M = 0.03
SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M = 0.045, 0.0005
DISTANCE_M = 0.16
SQUARES = {"green target": "green", "blue square": "blue", "pink square": "pink", "yellow square": "yellow"}
PUSH_HEIGHT_M = 0.022  # the fingers reach 8 mm lower
FINGER_HALF_M = 0.010  # of the closed fingers, in the direction of the push
BEHIND_M, RISE_M = 0.035, 0.10


class SlideBlock(SimTask):
    """A 6 cm block at x 0.12..0.30 m, y -0.15..0.15 m and four squares around it, each 16 cm away.

    As in RLBench block and squares are turned as a whole, by any angle. The block's pose is its center. The target's
    pose is its center; x points away from the block, towards the white stripe on its far edge. Success: some part of
    the block lies on the green square.
    """

    name = "slide_block"
    object_names = ("block", "green target")
    yaw_symmetry_deg: ClassVar[Mapping[str, float]] = {"block": 90.0}
    instruction = "slide the block to the green target"

    def build(self, random: np.random.Generator) -> None:
        center = np.array([*random.uniform((0.12, -0.15), (0.30, 0.15)), TABLE_TOP_M])
        yaw_rad = random.uniform(-np.pi, np.pi)
        self.add_cube("block", "red", center + BLOCK_HALF_M * UP, BLOCK_HALF_M, yaw_rad, mass_kg=0.15)
        for quarter, (name, color) in enumerate(SQUARES.items()):
            turn = about_z(yaw_rad + quarter * np.pi / 2)
            at_m = center + turn.apply([DISTANCE_M, 0, SQUARE_HALF_THICKNESS_M])
            square = self.add_part(name, at_m, turn)
            square.mark((SQUARE_HALF_M, SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M), color)
            stripe_m = [SQUARE_HALF_M - 0.006, 0, SQUARE_HALF_THICKNESS_M]
            square.mark((0.004, SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M), "white", at_m=stripe_m)

    def expert(self) -> list[Move]:
        touching_m = BLOCK_HALF_M + FINGER_HALF_M  # from the block's center
        start_m, end_m = -DISTANCE_M - touching_m - BEHIND_M, -touching_m
        route = [(start_m, RISE_M, LOOSE_M), (start_m, 0, BEHIND_M / 4), (end_m, 0, 0), (end_m, RISE_M, 0)]
        in_world = [
            (self.body_to_world("green target", [x_m, 0, PUSH_HEIGHT_M + rise_m]), within_m)
            for x_m, rise_m, within_m in route
        ]
        return push(in_world, self.tool_over("green target"))

    def succeeded(self) -> bool:
        """The block's inscribed circle reaches into the square."""
        offset = self.world_to_body("green target", self.position_m("block"))
        outside_m = np.maximum(np.abs(offset[:2]) - SQUARE_HALF_M, 0)
        return bool(np.linalg.norm(outside_m) < BLOCK_HALF_M)


SHAPE_HALF_M, SHAPE_KG = 0.020, 0.05
GRASP_M = 0.010  # above the cube's center
# The sorter's origin is the center of its square hole, in the upper face of its lid
HALF_WIDTH_M, HEIGHT_M, LID_M = 0.09, 0.064, 0.004
MIDDLE_M = np.array([0.035, 0.035, 0.0])  # of the lid
HOLE_HALF_M = 0.029
BAR_HOLE_M, CYLINDER_HOLE_M, PAINT_M = (0.035, 0.085, 0.0), (0.08, 0.015, 0.0), 0.0002
DROP_M, CLEARANCE_M = 0.002, 0.12


class SortShape(SimTask):
    """A cube, a cylinder and a bar around a box whose lid has a hole for the cube, all turned at random.

    The box's middle is in x 0.18..0.30 m, y -0.10..0.10 m, the shapes at least 19 cm from it in x 0.02..0.38 m,
    y -0.36..0.36 m. The cube's pose is its center. The sorter's pose is the center of its square hole, a quarter turn
    about which changes nothing for the cube. Success: the cube is in the box below the square hole's rim, where no
    other opening lets it in, and the gripper holds nothing.
    """

    name = "sort_shape"
    object_names = ("cube", "shape sorter")
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    instruction = "put the cube in the shape sorter"

    def build(self, random: np.random.Generator) -> None:
        middle = random.uniform((0.18, -0.10), (0.30, 0.10))
        turn = about_z(random.uniform(-np.pi, np.pi))
        hole_m = np.array([*middle, TABLE_TOP_M + HEIGHT_M]) - turn.apply(MIDDLE_M)
        _add_sorter(self.add_part("shape sorter", hole_m, turn))
        low_m, high_m = (0.02, -0.36), (0.38, 0.36)
        points = scatter(random, 3, low_m, high_m, min_distance_m=0.10, clear_of=[(middle, 0.19)])
        cube, cylinder, bar = (
            self.add_part(name, [*point, TABLE_TOP_M + SHAPE_HALF_M], about_z(random.uniform(-np.pi, np.pi)), free=True)
            for name, point in zip(("cube", "cylinder", "bar"), points, strict=True)
        )
        cube.box((SHAPE_HALF_M,) * 3, "red", mass_kg=SHAPE_KG)
        cylinder.cylinder(SHAPE_HALF_M, SHAPE_HALF_M, "blue", mass_kg=SHAPE_KG)
        bar.box((2 * SHAPE_HALF_M, SHAPE_HALF_M / 2, SHAPE_HALF_M), "green", mass_kg=SHAPE_KG)

    def expert(self) -> list[Move]:
        at = self.position_m("cube") + GRASP_M * UP
        in_hole = self.position_m("shape sorter") + (SHAPE_HALF_M + DROP_M + GRASP_M) * UP
        return carry([(at, self.tool_over("cube"), in_hole, self.tool_over("shape sorter"))], CLEARANCE_M)

    def succeeded(self) -> bool:
        offset = self.world_to_body("shape sorter", self.position_m("cube"))
        in_box = np.abs((offset - MIDDLE_M)[:2]).max() < HALF_WIDTH_M and -HEIGHT_M < offset[2] < -SHAPE_HALF_M
        return bool(in_box) and self.gripper_holds_nothing()


def _add_sorter(sorter: SceneBody) -> None:
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        half_sizes_m = (LID_M if x else HALF_WIDTH_M, LID_M if y else HALF_WIDTH_M, (HEIGHT_M - LID_M) / 2)
        at_m = MIDDLE_M + HALF_WIDTH_M * np.array([x, y, 0]) - (HEIGHT_M + LID_M) / 2 * UP
        sorter.box(half_sizes_m, "wood", at_m=at_m)
    low_m, high_m = MIDDLE_M[0] - HALF_WIDTH_M, MIDDLE_M[0] + HALF_WIDTH_M
    _add_lid(sorter, (low_m, -HOLE_HALF_M), (low_m, high_m))
    _add_lid(sorter, (HOLE_HALF_M, high_m), (low_m, high_m))
    _add_lid(sorter, (-HOLE_HALF_M, HOLE_HALF_M), (low_m, -HOLE_HALF_M))
    _add_lid(sorter, (-HOLE_HALF_M, HOLE_HALF_M), (HOLE_HALF_M, high_m))
    # The other shapes' holes are only painted on
    sorter.mark((2 * SHAPE_HALF_M, SHAPE_HALF_M / 2, PAINT_M), "black", at_m=BAR_HOLE_M)
    sorter.cylinder(SHAPE_HALF_M, PAINT_M, "black", at_m=CYLINDER_HOLE_M)


def _add_lid(sorter: SceneBody, x_m: tuple[float, float], y_m: tuple[float, float]) -> None:
    """The part of the lid between two limits along x and two along y."""
    (x_low, x_high), (y_low, y_high) = x_m, y_m
    center_m = [(x_low + x_high) / 2, (y_low + y_high) / 2, -LID_M / 2]
    sorter.box(((x_high - x_low) / 2, (y_high - y_low) / 2, LID_M / 2), "yellow", at_m=center_m)
