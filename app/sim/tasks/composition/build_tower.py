"""Build a tower as high as the instruction says."""

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import about_z, scatter
from app.sim.tasks.composition.base import BLOCK_HALF_M, MAX_HEIGHT_ERROR_M, CompositionTask
from app.sim.world import TABLE_TOP_M

COLOURS = ("red", "green", "blue", "yellow")
BLOCKS = tuple(f"{colour} block" for colour in COLOURS)
PLATE = "white plate"
SHOWN, ASKED = (1, 2, 4), (3,)  # blocks of the tower
PLATE_HALF_M, PLATE_HALF_HEIGHT_M = 0.05, 0.001
DROP_M = 0.004  # a block is released this far above what it shall rest on
LOW_M, HIGH_M = (0.02, -0.33), (0.38, 0.33)
PLATE_LOW_M, PLATE_HIGH_M = (0.12, -0.10), (0.30, 0.10)
MIN_DISTANCE_M, FROM_PLATE_M = 0.105, 0.13
MAX_OFFSET_M = 0.03


class BuildTower(CompositionTask):
    """Four 4.4 cm blocks about a white plate, each turned at random; poses are centres.

    Blocks lie in x 0.02..0.38 m, y -0.33..0.33 m, the plate in x 0.12..0.30 m, y -0.10..0.10 m. Demonstrated are towers
    of one, two and four blocks, asked for is one of three. Success: so many blocks, whichever they are, stand on each
    other on the plate, the others lie beside it, and the gripper holds nothing.
    """

    name = "build_tower"
    object_names = (*BLOCKS, PLATE)
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    variations, test_only_variations = len(SHOWN), len(ASKED)

    @property
    def height(self) -> int:
        """How many blocks the tower shall have."""
        return (*SHOWN, *ASKED)[self.variation]

    def build(self, random: np.random.Generator) -> None:
        centre = random.uniform(PLATE_LOW_M, PLATE_HIGH_M)
        plate_m = [*centre, TABLE_TOP_M + PLATE_HALF_HEIGHT_M]
        plate = self.add_part(PLATE, plate_m, about_z(random.uniform(-np.pi, np.pi)))
        plate.mark((PLATE_HALF_M, PLATE_HALF_M, PLATE_HALF_HEIGHT_M), "white")
        points = scatter(random, len(BLOCKS), LOW_M, HIGH_M, MIN_DISTANCE_M, clear_of=[(centre, FROM_PLATE_M)])
        for block, colour, point in zip(BLOCKS, COLOURS, points, strict=True):
            self.add_block(block, colour, point, random.uniform(-np.pi, np.pi))

    @property
    def instruction(self) -> str:
        return f"build a tower {self.height} high on the {PLATE}"

    def expert(self) -> list[Move]:
        foot = self.position_m(PLATE) + (BLOCK_HALF_M - PLATE_HALF_HEIGHT_M + DROP_M) * UP
        release = tool_down(nearest_yaw_rad(self.yaw_rad(PLATE), np.pi / 2))
        moves: list[Move] = []
        for storey, block in enumerate(BLOCKS[: self.height]):
            grasp = tool_down(nearest_yaw_rad(self.yaw_rad(block), np.pi / 2))
            moves += pick(self.position_m(block), grasp, straight=storey > 0)
            moves += place(foot + 2 * BLOCK_HALF_M * storey * UP, release, straight=True)
        return moves

    def succeeded(self) -> bool:
        offsets = np.array([self.position_m(block) - self.position_m(PLATE) for block in BLOCKS])
        stacked = np.hypot(offsets[:, 0], offsets[:, 1]) < MAX_OFFSET_M
        expected_m = BLOCK_HALF_M * (2 * np.arange(self.height) + 1)
        heights_m = np.sort(offsets[stacked, 2] + PLATE_HALF_HEIGHT_M)
        if len(heights_m) != self.height or np.abs(heights_m - expected_m).max() > MAX_HEIGHT_ERROR_M:
            return False
        aside = [block for block, in_tower in zip(BLOCKS, stacked, strict=True) if not in_tower]
        return all(map(self.on_table, aside)) and self.gripper_holds_nothing()
