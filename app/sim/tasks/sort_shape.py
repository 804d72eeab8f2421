"""Put the cube through the square hole of the shape sorter."""

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import Part, about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

HALF_SIZE_M, MASS_KG = 0.020, 0.05  # of every shape
GRASP_M = 0.010  # above the cube's centre
# The sorter's origin is the centre of its square hole, in the upper face of its lid
HALF_WIDTH_M, HEIGHT_M, BOARD_M = 0.09, 0.064, 0.004
MIDDLE_M = np.array([0.035, 0.035, 0.0])  # of the lid
HOLE_HALF_M = 0.029
BAR_HOLE_M, CYLINDER_HOLE_M, PAINT_M = (0.035, 0.085, 0.0), (0.08, 0.015, 0.0), 0.0002
DROP_M = 0.002
CLEARANCE_M = 0.12
SORTER_LOW_M, SORTER_HIGH_M = (0.18, -0.10), (0.30, 0.10)
LOW_M, HIGH_M = (0.02, -0.36), (0.38, 0.36)
MIN_DISTANCE_M, MIN_FROM_SORTER_M = 0.10, 0.19
SORTER = "shape sorter"


class SortShape(SimTask):
    """A cube, a cylinder and a bar around a box whose lid has a hole for the cube, all turned at random.

    The box's middle is in x 0.18..0.30 m, y -0.10..0.10 m, the shapes at least 19 cm from it in x 0.02..0.38 m,
    y -0.36..0.36 m. The cube's pose is its centre. The sorter's pose is the centre of its square hole, a quarter turn
    about which changes nothing for the cube. Success: the cube is in the box below the square hole's rim, where no
    other opening lets it in, and the gripper holds nothing.
    """

    name = "sort_shape"
    object_names = ("cube", SORTER)
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)

    def build(self, random: np.random.Generator) -> None:
        middle = random.uniform(SORTER_LOW_M, SORTER_HIGH_M)
        turn = about_z(random.uniform(-np.pi, np.pi))
        hole_m = np.array([*middle, TABLE_TOP_M + HEIGHT_M]) - turn.apply(MIDDLE_M)
        _add_sorter(self.add_part(SORTER, hole_m, turn))
        points = scatter(random, 3, LOW_M, HIGH_M, MIN_DISTANCE_M, clear_of=[(middle, MIN_FROM_SORTER_M)])
        cube, cylinder, bar = (
            self.add_part(name, [*point, TABLE_TOP_M + HALF_SIZE_M], about_z(random.uniform(-np.pi, np.pi)), free=True)
            for name, point in zip(("cube", "cylinder", "bar"), points, strict=True)
        )
        cube.box((HALF_SIZE_M,) * 3, "red", mass_kg=MASS_KG)
        cylinder.cylinder(HALF_SIZE_M, HALF_SIZE_M, "blue", mass_kg=MASS_KG)
        bar.box((2 * HALF_SIZE_M, HALF_SIZE_M / 2, HALF_SIZE_M), "green", mass_kg=MASS_KG)

    @property
    def instruction(self) -> str:
        return "put the cube in the shape sorter"

    def expert(self) -> list[Move]:
        grasp, release = (tool_down(nearest_yaw_rad(self.yaw_rad(name), np.pi / 2)) for name in self.object_names)
        at = self.position_m("cube") + GRASP_M * UP
        in_hole = self.position_m(SORTER) + (HALF_SIZE_M + DROP_M + GRASP_M) * UP
        return pick(at, grasp, CLEARANCE_M) + place(in_hole, release, CLEARANCE_M)

    def succeeded(self) -> bool:
        offset = self.rotation(SORTER).inv().apply(self.position_m("cube") - self.position_m(SORTER))
        in_box = np.abs((offset - MIDDLE_M)[:2]).max() < HALF_WIDTH_M and -HEIGHT_M < offset[2] < -HALF_SIZE_M
        return bool(in_box) and self.gripper_holds_nothing()


def _add_sorter(sorter: Part) -> None:
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        half_sizes_m = (BOARD_M if x else HALF_WIDTH_M, BOARD_M if y else HALF_WIDTH_M, (HEIGHT_M - BOARD_M) / 2)
        at_m = MIDDLE_M + HALF_WIDTH_M * np.array([x, y, 0]) - (HEIGHT_M + BOARD_M) / 2 * UP
        sorter.box(half_sizes_m, "wood", at_m=at_m)
    low_m, high_m = MIDDLE_M[0] - HALF_WIDTH_M, MIDDLE_M[0] + HALF_WIDTH_M
    _add_lid(sorter, (low_m, -HOLE_HALF_M), (low_m, high_m))
    _add_lid(sorter, (HOLE_HALF_M, high_m), (low_m, high_m))
    _add_lid(sorter, (-HOLE_HALF_M, HOLE_HALF_M), (low_m, -HOLE_HALF_M))
    _add_lid(sorter, (-HOLE_HALF_M, HOLE_HALF_M), (HOLE_HALF_M, high_m))
    # The other shapes' holes are only painted on
    sorter.mark((2 * HALF_SIZE_M, HALF_SIZE_M / 2, PAINT_M), "black", at_m=BAR_HOLE_M)
    sorter.cylinder(HALF_SIZE_M, PAINT_M, "black", at_m=CYLINDER_HOLE_M)


def _add_lid(sorter: Part, x_m: tuple[float, float], y_m: tuple[float, float]) -> None:
    """The part of the lid between two limits along x and two along y."""
    (x_low, x_high), (y_low, y_high) = x_m, y_m
    centre_m = [(x_low + x_high) / 2, (y_low + y_high) / 2, -BOARD_M / 2]
    sorter.box(((x_high - x_low) / 2, (y_high - y_low) / 2, BOARD_M / 2), "yellow", at_m=centre_m)
