"""Lay a wine bottle into the middle of a rack."""

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.moves import Move, pick, place, tool_down
from app.sim.scene import Part, about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

# The bottle, along z from the point of its neck where it is grasped
BOTTLE_RADIUS_M, NECK_RADIUS_M = 0.025, 0.012
BOTTOM_M, SHOULDER_M, CORK_M = -0.170, -0.050, 0.035
BODY_MIDDLE_M = (BOTTOM_M + SHOULDER_M) / 2
BOTTLE_KG, SHOULDER_KG, NECK_KG = 0.16, 0.02, 0.02
# The rack: two rails across the bottles, with pegs between its three places
PLACES_Y_M = (-0.08, 0.0, 0.08)
RAIL_X_M, RAIL_HALF_M = 0.04, (0.008, 0.13, 0.03)
PEG_HALF_M, PEG_HEIGHT_M = 0.008, 0.012  # on edge, so that a bottle slides off
PEGS_Y_M = (-0.12, -0.04, 0.04, 0.12)
TILT_RAD = 0.80  # of the tool at the neck: keeps the hand off the table and the bottle's top out of its palm
GRASP_YAW_RAD = np.pi / 2
CLEARANCE_M = 0.12
DROP_M = 0.008
RACK_LOW_M, RACK_HIGH_M = (0.12, -0.24), (0.28, -0.08)
FACING_RAD, MAX_TURN_RAD = np.pi / 2, np.pi / 4
BOTTLE_LOW_M, BOTTLE_HIGH_M = (0.05, 0.08), (0.25, 0.28)
MAX_ALONG_M, MAX_ACROSS_M, MAX_HEIGHT_ERROR_M, MIN_COSINE = 0.06, 0.03, 0.02, 0.9


class PlaceWine(SimTask):
    """A standing wine bottle to the robot's left and a rack of three places to its right.

    The rack's middle lies in x 0.12..0.28 m, y -0.24..-0.08 m; it is turned by up to 45 degrees either way as in
    RLBench. The bottle stands in x 0.05..0.25 m, y 0.08..0.28 m. The bottle's pose is the point of its neck to grasp.
    The rack's is the middle of its middle place, on the rails; bottles lie along its x axis, their corks forward.
    Success: the bottle lies in the middle place and the gripper holds nothing.
    """

    name = "place_wine"
    object_names = ("wine bottle", "rack")
    yaw_symmetry_deg = dict.fromkeys(("wine bottle",), 0.0)

    def build(self, random: np.random.Generator) -> None:
        middle = random.uniform(RACK_LOW_M, RACK_HIGH_M)
        turn = about_z(FACING_RAD + random.uniform(-MAX_TURN_RAD, MAX_TURN_RAD))
        _add_rails(self.add_part("rack", [*middle, TABLE_TOP_M + 2 * RAIL_HALF_M[2]], turn))
        spot = random.uniform(BOTTLE_LOW_M, BOTTLE_HIGH_M)
        _add_glass(self.add_part("wine bottle", [*spot, TABLE_TOP_M - BOTTOM_M], free=True))

    @property
    def instruction(self) -> str:
        return "stack the wine bottle to the middle of the rack"

    def expert(self) -> list[Move]:
        """The tool turns by 90 degrees about the axis of its fingers, so that the bottle it holds comes to lie."""
        grasp = tool_down(GRASP_YAW_RAD, TILT_RAD)
        release = tool_down(self.yaw_rad("rack"), TILT_RAD - np.pi / 2)
        lying_m = self.rotation("rack").apply([-BODY_MIDDLE_M, 0, BOTTLE_RADIUS_M + DROP_M])
        return [
            *pick(self.position_m("wine bottle"), grasp, CLEARANCE_M),
            *place(self.position_m("rack") + lying_m, release, CLEARANCE_M, straight=True),
        ]

    def succeeded(self) -> bool:
        to_rack, bottle = self.rotation("rack").inv(), self.rotation("wine bottle")
        body_m = self.position_m("wine bottle") + bottle.apply([0, 0, BODY_MIDDLE_M])
        x, y, z = to_rack.apply(body_m - self.position_m("rack"))
        along_rack = abs(to_rack.apply(bottle.apply([0, 0, 1]))[0]) > MIN_COSINE
        lies = along_rack and abs(z - BOTTLE_RADIUS_M) < MAX_HEIGHT_ERROR_M
        in_middle = abs(x) < MAX_ALONG_M and abs(y) < MAX_ACROSS_M
        return bool(lies and in_middle) and self.gripper_holds_nothing()


def _add_rails(rack: Part) -> None:
    on_edge = Rotation.from_euler("x", np.pi / 4)
    for x_m in (-RAIL_X_M, RAIL_X_M):
        rack.box(RAIL_HALF_M, "wood", at_m=[x_m, 0, -RAIL_HALF_M[2]])
        for y_m in PEGS_Y_M:
            rack.box((PEG_HALF_M,) * 3, "wood", at_m=[x_m, y_m, PEG_HEIGHT_M], rotation=on_edge)


def _add_glass(bottle: Part) -> None:
    half_body, half_neck = (SHOULDER_M - BOTTOM_M) / 2, (CORK_M - SHOULDER_M) / 2
    bottle.cylinder(BOTTLE_RADIUS_M, half_body, "purple", at_m=[0, 0, BODY_MIDDLE_M], mass_kg=BOTTLE_KG)
    bottle.sphere(BOTTLE_RADIUS_M, "purple", at_m=[0, 0, SHOULDER_M], mass_kg=SHOULDER_KG)
    bottle.cylinder(NECK_RADIUS_M, half_neck, "purple", at_m=[0, 0, SHOULDER_M + half_neck], mass_kg=NECK_KG)
