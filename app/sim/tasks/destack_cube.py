"""Take the upper of two cubes off the lower one and put it on the table."""

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import about_z
from app.sim.tasks.cubes import DROP_M, HALF_SIZE_M, MAX_HEIGHT_ERROR_M, CubeTask
from app.sim.world import TABLE_TOP_M

LOW_M, HIGH_M = (0.10, -0.12), (0.36, 0.26)
MAX_TWIST_RAD = 0.2  # between the two cubes
ASIDE_M = 0.15  # along the upper cube's -y, i.e. to the robot's right


class DestackCube(CubeTask):
    """Two 5 cm cubes, one on the other, in x 0.10..0.36 m, y -0.12..0.26 m, turned at random, up to 11 degrees apart.

    The range leaves room on the table to the right. A cube's pose is its centre. Success: the upper cube has landed on
    the table and the gripper holds nothing.
    """

    name = "destack_cube"
    ways = 2  # the fingers on one pair of the cube's faces or on the other

    def build(self, random: np.random.Generator) -> None:
        upper, lower = self.upper_and_lower
        point = random.uniform(LOW_M, HIGH_M)
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
