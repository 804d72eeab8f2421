"""What the cube tasks share: a blue and a yellow cube, of which the instruction names one as the upper."""

from app.pipeline.arrays import Array
from app.sim.scene import about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

HALF_SIZE_M = 0.025
MASS_KG = 0.09
DROP_M = 0.004  # a cube is released this far above what it shall rest on
MAX_HEIGHT_ERROR_M = 0.008


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
