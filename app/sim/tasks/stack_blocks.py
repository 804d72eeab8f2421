"""Stack two of four red blocks on the green platform."""

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

RED_BLOCKS = ("first red block", "second red block", "third red block", "fourth red block")
BLUE_BLOCKS = ("first blue block", "second blue block")
NUM_TO_STACK = 2
PLATFORM = "green platform"
HALF_SIZE_M, MASS_KG = 0.024, 0.08
PLATFORM_HALF_M, PLATFORM_HALF_HEIGHT_M = 0.05, 0.001
CLEARANCES_M = (0.10, 0.15)  # by way: how high blocks are carried
DROP_M = 0.005  # released this far above what is below
LOW_M, HIGH_M = (0.02, -0.33), (0.38, 0.33)
PLATFORM_LOW_M, PLATFORM_HIGH_M = (0.10, -0.10), (0.30, 0.10)
MIN_DISTANCE_M = 0.105


class StackBlocks(SimTask):
    """Four red and two blue 4.8 cm blocks about a green platform, each turned at random, at least 10.5 cm apart.

    Blocks lie in x 0.02..0.38 m, y -0.33..0.33 m, the platform in x 0.10..0.30 m, y -0.10..0.10 m. Poses are centres.
    The red blocks are numbered by their distance from the platform. Success: two red blocks or more, whichever they
    are, are inside the platform's area and the gripper holds nothing.
    """

    name = "stack_blocks"
    ways = len(CLEARANCES_M)
    object_names = (*RED_BLOCKS[:NUM_TO_STACK], PLATFORM)
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)

    def build(self, random: np.random.Generator) -> None:
        centre = random.uniform(PLATFORM_LOW_M, PLATFORM_HIGH_M)
        platform_m = [*centre, TABLE_TOP_M + PLATFORM_HALF_HEIGHT_M]
        platform = self.add_part(PLATFORM, platform_m, about_z(random.uniform(-np.pi, np.pi)))
        platform.mark((PLATFORM_HALF_M, PLATFORM_HALF_M, PLATFORM_HALF_HEIGHT_M), "green")
        count = len(RED_BLOCKS) + len(BLUE_BLOCKS)
        points = scatter(random, count, LOW_M, HIGH_M, MIN_DISTANCE_M, clear_of=[(centre, MIN_DISTANCE_M)])
        red = sorted(points[: len(RED_BLOCKS)], key=lambda point: float(np.linalg.norm(point - centre)))
        for name, point in zip((*RED_BLOCKS, *BLUE_BLOCKS), (*red, *points[len(red) :]), strict=True):
            turn = about_z(random.uniform(-np.pi, np.pi))
            block = self.add_part(name, [*point, TABLE_TOP_M + HALF_SIZE_M], turn, free=True)
            block.box((HALF_SIZE_M,) * 3, "red" if name in RED_BLOCKS else "blue", mass_kg=MASS_KG)

    @property
    def instruction(self) -> str:
        return "stack 2 red blocks on the green platform"

    def expert(self) -> list[Move]:
        on_platform = self.position_m(PLATFORM) + (PLATFORM_HALF_HEIGHT_M + HALF_SIZE_M + DROP_M) * UP
        release = tool_down(nearest_yaw_rad(self.yaw_rad(PLATFORM), np.pi / 2))
        moves: list[Move] = []
        for storey, block in enumerate(RED_BLOCKS[:NUM_TO_STACK]):
            grasp = tool_down(nearest_yaw_rad(self.yaw_rad(block), np.pi / 2))
            moves += pick(self.position_m(block), grasp, CLEARANCES_M[self.way])
            moves += place(on_platform + 2 * HALF_SIZE_M * storey * UP, release, CLEARANCES_M[self.way])
        return moves

    def succeeded(self) -> bool:
        inside = sum(self._is_inside(block) for block in RED_BLOCKS)
        return inside >= NUM_TO_STACK and self.gripper_holds_nothing()

    def _is_inside(self, block: str) -> bool:
        offset = self.rotation(PLATFORM).inv().apply(self.position_m(block) - self.position_m(PLATFORM))
        return bool(np.abs(offset[:2]).max() < PLATFORM_HALF_M)
