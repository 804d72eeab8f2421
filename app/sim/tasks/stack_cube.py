"""Stack one cube on the other."""

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import scatter
from app.sim.tasks.cubes import DROP_M, HALF_SIZE_M, MAX_HEIGHT_ERROR_M, CubeTask

MIN_DISTANCE_M = 0.11
LOW_M, HIGH_M = (0.05, -0.28), (0.38, 0.28)
CLEARANCES_M = (0.10, 0.16)  # by way: how high the cube is carried
MAX_OFFSET_M = 0.03


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
