"""Stack one cube on the other."""

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

HALF_SIZE_M = 0.025
MASS_KG = 0.09
MIN_DISTANCE_M = 0.11
LOW_M, HIGH_M = (0.05, -0.28), (0.38, 0.28)
DROP_M = 0.004  # released this far above the lower cube
MAX_OFFSET_M, MAX_HEIGHT_ERROR_M = 0.03, 0.008


class StackCube(SimTask):
    """Two 5 cm cubes on the table, centres at least 11 cm apart, in x 0.05..0.38 m, y -0.28..0.28 m, turned at random.

    A cube's pose is its centre. Success: the right cube rests on the other and the gripper holds nothing.
    """

    name = "stack_cube"
    object_names = ("blue cube", "yellow cube")
    variations = 2
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)

    def build(self, random: np.random.Generator) -> None:
        for name, point in zip(self.object_names, scatter(random, 2, LOW_M, HIGH_M, MIN_DISTANCE_M), strict=True):
            yaw_rad = random.uniform(-np.pi, np.pi)
            cube = self.add_part(name, [*point, TABLE_TOP_M + HALF_SIZE_M], about_z(yaw_rad), free=True)
            cube.box((HALF_SIZE_M,) * 3, name.split()[0], mass_kg=MASS_KG)

    @property
    def _upper_and_lower(self) -> tuple[str, str]:
        blue, yellow = self.object_names
        return (blue, yellow) if self.variation == 0 else (yellow, blue)

    @property
    def instruction(self) -> str:
        upper, lower = self._upper_and_lower
        return f"stack the {upper} on the {lower}."

    def expert(self) -> list[Move]:
        upper, lower = self._upper_and_lower
        grasp, release = (tool_down(nearest_yaw_rad(self.yaw_rad(cube), np.pi / 2)) for cube in (upper, lower))
        on_top = self.position_m(lower) + (2 * HALF_SIZE_M + DROP_M) * UP
        return pick(self.position_m(upper), grasp) + place(on_top, release)

    def succeeded(self) -> bool:
        upper, lower = self._upper_and_lower
        x, y, z = self.position_m(upper) - self.position_m(lower)
        rests_on_it = np.hypot(x, y) < MAX_OFFSET_M and abs(z - 2 * HALF_SIZE_M) < MAX_HEIGHT_ERROR_M
        return bool(rests_on_it) and self.gripper_holds_nothing()
