"""Screw the lid on the red jar."""

import numpy as np

from app.sim.moves import UP, Move, move_to, pick, tool_down
from app.sim.scene import scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

OTHER_COLOURS = ("blue", "purple", "green", "orange")
JAR_HEIGHT_M, JAR_RADIUS_M, GLASS_M = 0.08, 0.034, 0.006
# The lid is a disc with a plug beneath it; its origin is the disc's centre
LID_RADIUS_M, LID_HALF_HEIGHT_M = 0.033, 0.010
PLUG_RADIUS_M, PLUG_HALF_HEIGHT_M = 0.020, 0.005
LIFTED_M = 2 * PLUG_HALF_HEIGHT_M  # the lid's height on the table, so that it stands on its plug
RELEASE_M = 0.002  # above the rim
CLEARANCE_M = 0.10
TURN_RAD = np.pi / 4  # from this to as much the other way
MIN_DISTANCE_M = 0.16  # a jar hides no more than a part of the lid from the front camera
LOW_M, HIGH_M = (0.05, -0.25), (0.36, 0.25)
MAX_OFFSET_M, MAX_HEIGHT_ERROR_M, MIN_UPRIGHT = 0.012, 0.004, 0.98


class CloseJar(SimTask):
    """A red jar, one of another colour and a lid, at least 16 cm apart in x 0.05..0.36 m, y -0.25..0.25 m.

    All are round, so that RLBench's turns of up to 108 degrees mean nothing here. The jar's pose is the centre of its
    rim, the lid's the centre of its disc. Success: the lid lies on the red jar and the gripper holds nothing.
    """

    name = "close_jar"
    object_names = ("lid", "red jar")
    yaw_symmetry_deg = dict.fromkeys(object_names, 0.0)

    def build(self, random: np.random.Generator) -> None:
        lid_at, red_at, other_at = scatter(random, 3, LOW_M, HIGH_M, MIN_DISTANCE_M)
        lid = self.add_part("lid", [*lid_at, TABLE_TOP_M + LIFTED_M + LID_HALF_HEIGHT_M], free=True)
        lid.cylinder(LID_RADIUS_M, LID_HALF_HEIGHT_M, "grey", mass_kg=0.05)
        plug_at_m = [0, 0, -LID_HALF_HEIGHT_M - PLUG_HALF_HEIGHT_M]
        lid.cylinder(PLUG_RADIUS_M, PLUG_HALF_HEIGHT_M, "grey", at_m=plug_at_m, mass_kg=0.02)
        for colour, at in (("red", red_at), (random.choice(OTHER_COLOURS), other_at)):
            jar = self.add_part(f"{colour} jar", [*at, TABLE_TOP_M + JAR_HEIGHT_M])
            jar.wall(colour, bottom_m=-JAR_HEIGHT_M, top_m=0, bottom_radius_m=JAR_RADIUS_M, thickness_m=GLASS_M)
            jar.cylinder(JAR_RADIUS_M, 0.004, colour, at_m=[0, 0, 0.004 - JAR_HEIGHT_M])

    @property
    def instruction(self) -> str:
        return "close the red jar"

    def expert(self) -> list[Move]:
        on_rim = self.position_m("red jar") + (LID_HALF_HEIGHT_M + RELEASE_M) * UP
        above = on_rim + CLEARANCE_M * UP
        start, end = tool_down(TURN_RAD), tool_down(-TURN_RAD)
        return [
            *pick(self.position_m("lid"), tool_down(), CLEARANCE_M),
            move_to(above, start, gripper_open=False, straight=False),
            move_to(on_rim, start, gripper_open=False, within_m=RELEASE_M),
            move_to(on_rim, end, gripper_open=True),
            move_to(above, end, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        x, y, z = self.position_m("lid") - self.position_m("red jar")
        upright = self.rotation("lid").apply(UP)[2] > MIN_UPRIGHT
        closes_it = np.hypot(x, y) < MAX_OFFSET_M and abs(z - LID_HALF_HEIGHT_M) < MAX_HEIGHT_ERROR_M and upright
        return bool(closes_it) and self.gripper_holds_nothing()
