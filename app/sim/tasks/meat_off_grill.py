"""Take the chicken off the grill and put it on the table beside it."""

import numpy as np

from app.sim.moves import Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import Part, about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

# The grill's origin is the centre of its grate
HALF_DEPTH_M, HALF_WIDTH_M, HEIGHT_M = 0.10, 0.14, 0.088
FEET_M, BAR_RADIUS_M, NUM_BARS = 0.03, 0.003, 11
# A piece of meat is a box between two round ends along its x axis
MEAT_HALF_LENGTH_M, MEAT_HALF_WIDTH_M, MEAT_HALF_HEIGHT_M = 0.025, 0.020, 0.014
MEAT_MASS_KG = 0.1
SUNK_M = 0.0005  # of the box below the ends: surfaces in one plane flicker
MEAT = {"chicken": ("orange", 0.065), "steak": ("red", -0.065)}  # colour, and place on the grate along y, m
MAX_SHIFT_M = 0.03  # of the meat along x
BESIDE_M = 0.26  # from the grill's centre along y to where the chicken goes
DROP_M = 0.004
CLEARANCE_M = 0.15  # the arm swings over the grill on its way
MAX_TURN_RAD = np.radians(60.0)
LOW_M, HIGH_M = (0.14, -0.18), (0.28, -0.02)
MAX_DISTANCE_M, MIN_GAP_M, MAX_HEIGHT_ERROR_M = 0.10, 0.01, 0.006


class MeatOffGrill(SimTask):
    """Chicken and steak on a grill, its centre in x 0.14..0.28 m, y -0.18..-0.02 m.

    The grill is turned by up to 60 degrees either way (RLBench: 180), as the arm must reach the table on its +y side;
    the meat lies up to 3 cm off the middle of its half and is turned at random. The grill's pose is the centre of its
    grate, the chicken's its centre, x along it. Success: the chicken lies on the table on the grill's +y side and the
    gripper holds nothing.
    """

    name = "meat_off_grill"
    object_names = ("chicken", "grill")
    yaw_symmetry_deg = dict.fromkeys(("chicken",), 180.0)

    def build(self, random: np.random.Generator) -> None:
        turn = about_z(random.uniform(-MAX_TURN_RAD, MAX_TURN_RAD))
        centre = np.array([*random.uniform(LOW_M, HIGH_M), TABLE_TOP_M + HEIGHT_M])
        _add_grill(self.add_part("grill", centre, turn))
        for name, (colour, y_m) in MEAT.items():
            at = [random.uniform(-MAX_SHIFT_M, MAX_SHIFT_M), y_m, MEAT_HALF_HEIGHT_M]
            meat = self.add_part(name, centre + turn.apply(at), about_z(random.uniform(-np.pi, np.pi)), free=True)
            _add_meat(meat, colour)

    @property
    def instruction(self) -> str:
        return "take the chicken off the grill"

    def expert(self) -> list[Move]:
        beside = self.position_m("grill") + self.rotation("grill").apply([0, BESIDE_M, 0])
        beside[2] = TABLE_TOP_M + MEAT_HALF_HEIGHT_M + DROP_M
        grasp = tool_down(nearest_yaw_rad(self.yaw_rad("chicken")))
        release = tool_down(self.yaw_rad("grill"))
        return pick(self.position_m("chicken"), grasp, CLEARANCE_M) + place(beside, release, CLEARANCE_M)

    def succeeded(self) -> bool:
        x, y, z = self.rotation("grill").inv().apply(self.position_m("chicken") - self.position_m("grill"))
        on_table = abs(z + HEIGHT_M - MEAT_HALF_HEIGHT_M) < MAX_HEIGHT_ERROR_M
        beside = abs(x) < HALF_DEPTH_M and abs(y - BESIDE_M) < MAX_DISTANCE_M
        return bool(on_table and beside) and self.gripper_holds_nothing()


def _add_grill(grill: Part) -> None:
    """A box of coals on feet below the bars of the grate, a handle in front."""
    half_height_m = (HEIGHT_M - FEET_M) / 2 - BAR_RADIUS_M
    grill.box((HALF_DEPTH_M, HALF_WIDTH_M, half_height_m), "black", at_m=[0, 0, -half_height_m - 2 * BAR_RADIUS_M])
    for x_m in (-HALF_DEPTH_M, HALF_DEPTH_M):
        for y_m in (-HALF_WIDTH_M, HALF_WIDTH_M):
            foot_at_m = np.array([0.9 * x_m, 0.9 * y_m, FEET_M / 2 - HEIGHT_M])
            grill.cylinder(0.010, FEET_M / 2, "grey", at_m=foot_at_m)
    for y_m in np.linspace(-0.95, 0.95, NUM_BARS) * HALF_WIDTH_M:
        grill.box((HALF_DEPTH_M, BAR_RADIUS_M, BAR_RADIUS_M), "grey", at_m=[0, y_m, -BAR_RADIUS_M])


def _add_meat(meat: Part, colour: str) -> None:
    third_kg = MEAT_MASS_KG / 3
    meat.box((MEAT_HALF_LENGTH_M, MEAT_HALF_WIDTH_M, MEAT_HALF_HEIGHT_M - SUNK_M), colour, mass_kg=third_kg)
    for x_m in (-MEAT_HALF_LENGTH_M, MEAT_HALF_LENGTH_M):
        meat.cylinder(MEAT_HALF_WIDTH_M, MEAT_HALF_HEIGHT_M, colour, at_m=[x_m, 0, 0], mass_kg=third_kg)
