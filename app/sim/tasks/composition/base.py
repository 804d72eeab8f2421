"""What the tasks of compositions share: tests ask for combinations that no demonstration shows."""

from app.sim.scene import about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.arrays import Array

BLOCK_HALF_M, BLOCK_KG = 0.022, 0.07
MAX_HEIGHT_ERROR_M = 0.008


class CompositionTask(SimTask):
    """The parts of every plan are demonstrated, some combinations of them are not: these are the test-only variations.

    Copying a demonstration therefore fails, whichever it is.
    """

    @classmethod
    def test_variation(cls, seed: int) -> int:
        """The combinations that no demonstration shows, in turn."""
        return cls.variations + seed % cls.test_only_variations

    def add_block(self, name: str, colour: str, point_m: Array, yaw_rad: float) -> None:
        """A 4.4 cm block over a point (2,) of the table; for use in `build`."""
        block = self.add_part(name, [*point_m, TABLE_TOP_M + BLOCK_HALF_M], about_z(yaw_rad), free=True)
        block.box((BLOCK_HALF_M,) * 3, colour, mass_kg=BLOCK_KG)

    def on_table(self, block: str) -> bool:
        """Whether a block lies flat on the table."""
        return bool(abs(self.position_m(block)[2] - TABLE_TOP_M - BLOCK_HALF_M) < MAX_HEIGHT_ERROR_M)
