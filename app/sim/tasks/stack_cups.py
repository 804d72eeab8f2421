"""Stack two cups inside the green one."""

import numpy as np

from app.sim.moves import UP, Move, pick, place, tool_down
from app.sim.scene import scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

TARGET, OTHERS = "green cup", ("red cup", "blue cup")
# A cup is a cone of facets; its origin is the centre of its rim
HEIGHT_M, BOTTOM_RADIUS_M, RIM_RADIUS_M = 0.085, 0.026, 0.037
WALL_M, BOTTOM_M = 0.003, 0.004
WALL_KG, BOTTOM_KG = 0.048, 0.02
WALL_FRICTION = 0.25  # smooth, so that a cup slides into another
# One finger in the cup, one outside: the tool's point is in the wall on the cup's -y side, a little below the rim
GRASP_M = np.array([0.0, -0.0355, -0.010])
NESTED_M = 0.022  # how much higher a cup's rim is than that of the cup around it: the walls then touch
RELEASE_M = 0.013  # above that
CLEARANCE_M = 0.14
MIN_DISTANCE_M = 0.15
LOW_M, HIGH_M = (0.06, -0.25), (0.36, 0.25)
MAX_OFFSET_M, MIN_UPRIGHT = 0.02, 0.95
LOWEST_M = 0.004  # a cup that is inside another stands this much higher than it, and less than a cup's height


class StackCups(SimTask):
    """A red, a green and a blue cup at least 15 cm apart in x 0.06..0.36 m, y -0.25..0.25 m, not turned, as in RLBench.

    A cup's pose is the centre of its rim. Success: the red and the blue cup stand inside the green one and the gripper
    holds nothing.
    """

    name = "stack_cups"
    object_names = (*OTHERS, TARGET)
    yaw_symmetry_deg = dict.fromkeys(object_names, 0.0)

    def build(self, random: np.random.Generator) -> None:
        points = scatter(random, len(self.object_names), LOW_M, HIGH_M, MIN_DISTANCE_M)
        for name, point in zip(self.object_names, points, strict=True):
            colour = name.split()[0]
            cup = self.add_part(name, [*point, TABLE_TOP_M + HEIGHT_M], free=True)
            cup.cylinder(BOTTOM_RADIUS_M, BOTTOM_M / 2, colour, at_m=[0, 0, BOTTOM_M / 2 - HEIGHT_M], mass_kg=BOTTOM_KG)
            cup.wall(
                colour,
                bottom_m=BOTTOM_M - HEIGHT_M,
                top_m=0,
                bottom_radius_m=BOTTOM_RADIUS_M,
                top_radius_m=RIM_RADIUS_M,
                thickness_m=WALL_M,
                mass_kg=WALL_KG,
                friction=WALL_FRICTION,
            )

    @property
    def instruction(self) -> str:
        return "stack the red cup and the blue cup inside the green cup"

    def expert(self) -> list[Move]:
        down = tool_down()
        target = self.position_m(TARGET) + GRASP_M + RELEASE_M * UP
        moves: list[Move] = []
        for cups_below, cup in enumerate(OTHERS, start=1):
            moves += pick(self.position_m(cup) + GRASP_M, down, CLEARANCE_M)
            moves += place(target + cups_below * NESTED_M * UP, down, CLEARANCE_M)
        return moves

    def succeeded(self) -> bool:
        return all(self._is_inside(cup) for cup in OTHERS) and self.gripper_holds_nothing()

    def _is_inside(self, cup: str) -> bool:
        x, y, z = self.position_m(cup) - self.position_m(TARGET)
        upright = self.rotation(cup).apply(UP)[2] > MIN_UPRIGHT
        return bool(np.hypot(x, y) < MAX_OFFSET_M and LOWEST_M < z < HEIGHT_M and upright)
