"""The tasks pick_from_conveyor and pick_drifting: pick up a cube on something that runs.

They share a carrier, a slab on the table. It stays where it is and has a surface that moves: after each step its joints
are put back, and keep their speed, so that contacts feel a belt without end.
"""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from app.sim.moves import Move, pick
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.arrays import Array

HALF_SIZE_M, MASS_KG = 0.025, 0.09
CARRIER_KG = 50.0  # so heavy that the cube does not slow it between two steps
HALF_THICKNESS_M = 0.01
FRICTION = 1.0
SPEEDS_M_S = (0.02, 0.05, 0.10)
HELD_M = 0.06  # above where it lay
CUBE = "red cube"


class CarriedCube(SimTask):
    """A 5 cm cube on a slab 2 cm thick that runs at 0 (demonstrations), 2, 5 or 10 cm/s (tests).

    The cube's pose is its center. Success: it is held at least 6 cm higher than it lay.
    """

    object_names = (CUBE,)
    instruction = f"pick up the {CUBE}"
    test_only_variations = len(SPEEDS_M_S)
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    carrier_at_m: ClassVar[tuple[float, float]]  # of the slab's middle
    carrier_half_m: ClassVar[tuple[float, float]]

    @property
    def speed_m_s(self) -> float:
        """Of the carrier's surface."""
        return 0.0 if self.variation == 0 else SPEEDS_M_S[self.variation - 1]

    @abstractmethod
    def draw(self, random: np.random.Generator) -> tuple[Array, Array]:
        """The direction (2,) in which the carrier runs, and the cube's place (2,) upstream, m."""

    def build(self, random: np.random.Generator) -> None:
        self._direction, place_m = self.draw(random)
        slab = self.add_part("carrier", [*self.carrier_at_m, TABLE_TOP_M + HALF_THICKNESS_M])
        for joint, axis in (("runs_x", (1, 0, 0)), ("runs_y", (0, 1, 0))):
            slab.slide(joint, axis, (-1.0, 1.0), damping=0.0)
        slab.box((*self.carrier_half_m, HALF_THICKNESS_M), "grey", mass_kg=CARRIER_KG, friction=FRICTION)
        self._lay_m = TABLE_TOP_M + 2 * HALF_THICKNESS_M + HALF_SIZE_M
        yaw_rad = random.uniform(-np.pi, np.pi)
        at_m = [*place_m, self._lay_m]
        self.add_cube(CUBE, "red", at_m, HALF_SIZE_M, yaw_rad, mass_kg=MASS_KG, friction=FRICTION)

    def latch(self) -> None:
        """Put the carrier back, and let it run on."""
        for joint, share in zip(("runs_x", "runs_y"), self._direction, strict=True):
            self.data.joint(joint).qpos, self.data.joint(joint).qvel = 0.0, self.speed_m_s * share

    def expert(self) -> list[Move]:
        return pick(self.position_m(CUBE), self.tool_over(CUBE))

    def succeeded(self) -> bool:
        return bool(self.position_m(CUBE)[2] - self._lay_m > HELD_M)


class PickFromConveyor(CarriedCube):
    """A belt of 18 x 80 cm along y, which runs one way or the other; the cube starts 26 to 34 cm before its middle."""

    name = "pick_from_conveyor"
    carrier_at_m = (0.28, 0.0)
    carrier_half_m = (0.09, 0.40)

    def draw(self, random: np.random.Generator) -> tuple[Array, Array]:
        heading = random.choice([-1.0, 1.0])
        x_m = self.carrier_at_m[0] + random.uniform(-0.05, 0.05)
        return np.array([0.0, heading]), np.array([x_m, -heading * random.uniform(0.26, 0.34)])


class PickDrifting(CarriedCube):
    """A slab of 50 x 70 cm that drifts in any direction; the cube starts 14 to 18 cm upstream of its middle."""

    name = "pick_drifting"
    carrier_at_m = (0.22, 0.0)
    carrier_half_m = (0.25, 0.35)

    def draw(self, random: np.random.Generator) -> tuple[Array, Array]:
        angle_rad = random.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(angle_rad), np.sin(angle_rad)])
        return direction, np.array(self.carrier_at_m) - random.uniform(0.14, 0.18) * direction
