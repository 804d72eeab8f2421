"""The cube tasks: `stack_cube` puts one cube on the other, `destack_cube` puts the upper one on the table.

They share a blue and a yellow cube, of which the instruction names one as the upper.
"""

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.arrays import Array

HALF_SIZE_M = 0.025
MASS_KG = 0.09
DROP_M = 0.004  # a cube is released this far above what it shall rest on
MAX_HEIGHT_ERROR_M = 0.008
MIN_DISTANCE_M = 0.11
LOW_M, HIGH_M = (0.05, -0.28), (0.38, 0.28)
CLEARANCES_M = (0.10, 0.16)  # by way: how high the cube is carried
MAX_OFFSET_M = 0.03
TOWER_LOW_M, TOWER_HIGH_M = (0.10, -0.12), (0.36, 0.26)
MAX_TWIST_RAD = 0.2  # between the two cubes
ASIDE_M = 0.15  # along the upper cube's -y, i.e. to the robot's right


class CubeTask(SimTask):
    """Two 5 cm cubes. A cube's pose is its centre."""

    object_names = ("blue cube", "yellow cube")
    variations = 2
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)

    @property
    def upper_and_lower(self) -> tuple[str, str]:
        """Which cube the instruction calls the one on top, and the other."""
        blue, yellow = self.object_names
        return (blue, yellow) if self.variation == 0 else (yellow, blue)

    def add_cube(self, name: str, point_m: Array, yaw_rad: float, storey: int = 0) -> None:
        """A cube over a point (2,) of the table, on `storey` others; for use in `build`."""
        height_m = TABLE_TOP_M + (2 * storey + 1) * HALF_SIZE_M
        cube = self.add_part(name, [*point_m, height_m], about_z(yaw_rad), free=True)
        cube.box((HALF_SIZE_M,) * 3, name.split()[0], mass_kg=MASS_KG)


class StackCube(CubeTask):
    """Two 5 cm cubes on the table, centres at least 11 cm apart, in x 0.05..0.38 m, y -0.28..0.28 m, turned at random.

    A cube's pose is its centre. Success: the right cube rests on the other and the gripper holds nothing.
    """

    name = "stack_cube"
    ways = len(CLEARANCES_M)

    def build(self, random: np.random.Generator) -> None:
        for name, point in zip(self.object_names, scatter(random, 2, LOW_M, HIGH_M, MIN_DISTANCE_M), strict=True):
            self.add_cube(name, point, random.uniform(-np.pi, np.pi))

    @property
    def instruction(self) -> str:
        upper, lower = self.upper_and_lower
        return f"stack the {upper} on the {lower}."

    def expert(self) -> list[Move]:
        upper, lower = self.upper_and_lower
        grasp, release = (tool_down(nearest_yaw_rad(self.yaw_rad(cube), np.pi / 2)) for cube in (upper, lower))
        on_top = self.position_m(lower) + (2 * HALF_SIZE_M + DROP_M) * UP
        clearance_m = CLEARANCES_M[self.way]
        return pick(self.position_m(upper), grasp, clearance_m) + place(on_top, release, clearance_m)

    def succeeded(self) -> bool:
        upper, lower = self.upper_and_lower
        x, y, z = self.position_m(upper) - self.position_m(lower)
        rests_on_it = np.hypot(x, y) < MAX_OFFSET_M and abs(z - 2 * HALF_SIZE_M) < MAX_HEIGHT_ERROR_M
        return bool(rests_on_it) and self.gripper_holds_nothing()


class DestackCube(CubeTask):
    """Two 5 cm cubes, one on the other, in x 0.10..0.36 m, y -0.12..0.26 m, turned at random, up to 11 degrees apart.

    The range leaves room on the table to the right. A cube's pose is its centre. Success: the upper cube has landed on
    the table and the gripper holds nothing.
    """

    name = "destack_cube"
    ways = 2  # the fingers on one pair of the cube's faces or on the other

    def build(self, random: np.random.Generator) -> None:
        upper, lower = self.upper_and_lower
        point = random.uniform(TOWER_LOW_M, TOWER_HIGH_M)
        yaw_rad = random.uniform(-np.pi, np.pi)
        self.add_cube(lower, point, yaw_rad)
        self.add_cube(upper, point, yaw_rad + random.uniform(-MAX_TWIST_RAD, MAX_TWIST_RAD), storey=1)

    @property
    def instruction(self) -> str:
        upper, lower = self.upper_and_lower
        return f"destack the {upper} that is on the {lower}."

    def expert(self) -> list[Move]:
        upper, _ = self.upper_and_lower
        yaw_rad = nearest_yaw_rad(self.yaw_rad(upper), np.pi / 2)
        quarter_turn_rad = -np.copysign(np.pi / 2, yaw_rad) * self.way
        grasp, at = tool_down(yaw_rad + quarter_turn_rad), self.position_m(upper)
        aside = at + about_z(yaw_rad).apply([0, -ASIDE_M, 0]) + (DROP_M - 2 * HALF_SIZE_M) * UP
        return pick(at, grasp) + place(aside, grasp)

    def succeeded(self) -> bool:
        upper, _ = self.upper_and_lower
        height_m = self.position_m(upper)[2] - TABLE_TOP_M
        return bool(abs(height_m - HALF_SIZE_M) < MAX_HEIGHT_ERROR_M) and self.gripper_holds_nothing()
