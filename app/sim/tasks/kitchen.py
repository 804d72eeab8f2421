"""In the kitchen: `meat_off_grill`, `place_wine` and `turn_tap`."""

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.moves import UP, Move, carry, move_to, pick, place, tool_down
from app.sim.scene import SceneBody, about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

# The grill's origin is the center of its grate
GRILL_HALF_DEPTH_M, GRILL_HALF_WIDTH_M, GRILL_HEIGHT_M = 0.10, 0.14, 0.088
FEET_M, BAR_RADIUS_M, NUM_BARS = 0.03, 0.003, 11
# A piece of meat is a box between two round ends along its x axis
MEAT_HALF_LENGTH_M, MEAT_HALF_WIDTH_M, MEAT_HALF_HEIGHT_M = 0.025, 0.020, 0.014
MEAT_MASS_KG = 0.1
SUNK_M = 0.0005  # of the box below the ends: surfaces in one plane flicker
MEAT = {"chicken": ("orange", 0.065), "steak": ("red", -0.065)}  # color, and place on the grate along y, m
MAX_SHIFT_M = 0.03  # of the meat along x
BESIDE_M = 0.26  # from the grill's center along y to where the chicken goes
MEAT_DROP_M = 0.004
OVER_GRILL_M = 0.15  # the arm swings over the grill on its way
GRILL_MAX_TURN_RAD = np.radians(60.0)
MAX_DISTANCE_M, MEAT_HEIGHT_ERROR_M = 0.10, 0.006


class MeatOffGrill(SimTask):
    """Chicken and steak on a grill, its center in x 0.14..0.28 m, y -0.18..-0.02 m.

    The grill is turned by up to 60 degrees either way (RLBench: 180), as the arm must reach the table on its +y side;
    the meat lies up to 3 cm off the middle of its half and is turned at random. The grill's pose is the center of its
    grate, the chicken's its center, x along it. Success: the chicken lies on the table on the grill's +y side and the
    gripper holds nothing.
    """

    name = "meat_off_grill"
    object_names = ("chicken", "grill")
    yaw_symmetry_deg = dict.fromkeys(("chicken",), 180.0)
    instruction = "take the chicken off the grill"

    def build(self, random: np.random.Generator) -> None:
        turn = about_z(random.uniform(-GRILL_MAX_TURN_RAD, GRILL_MAX_TURN_RAD))
        center = np.array([*random.uniform((0.14, -0.18), (0.28, -0.02)), TABLE_TOP_M + GRILL_HEIGHT_M])
        _add_grill(self.add_part("grill", center, turn))
        for name, (color, y_m) in MEAT.items():
            at = [random.uniform(-MAX_SHIFT_M, MAX_SHIFT_M), y_m, MEAT_HALF_HEIGHT_M]
            meat = self.add_part(name, center + turn.apply(at), about_z(random.uniform(-np.pi, np.pi)), free=True)
            _add_meat(meat, color)

    def expert(self) -> list[Move]:
        beside = self.body_to_world("grill", [0, BESIDE_M, 0])
        beside[2] = TABLE_TOP_M + MEAT_HALF_HEIGHT_M + MEAT_DROP_M
        return carry([(*self.grasp("chicken"), beside, self.tool_over("grill"))], OVER_GRILL_M)

    def succeeded(self) -> bool:
        x, y, z = self.world_to_body("grill", self.position_m("chicken"))
        on_table = abs(z + GRILL_HEIGHT_M - MEAT_HALF_HEIGHT_M) < MEAT_HEIGHT_ERROR_M
        beside = abs(x) < GRILL_HALF_DEPTH_M and abs(y - BESIDE_M) < MAX_DISTANCE_M
        return bool(on_table and beside) and self.gripper_holds_nothing()


def _add_grill(grill: SceneBody) -> None:
    """A box of coals on feet below the bars of the grate, a handle in front."""
    half_height_m = (GRILL_HEIGHT_M - FEET_M) / 2 - BAR_RADIUS_M
    coals_at_m = [0, 0, -half_height_m - 2 * BAR_RADIUS_M]
    grill.box((GRILL_HALF_DEPTH_M, GRILL_HALF_WIDTH_M, half_height_m), "black", at_m=coals_at_m)
    for x_m in (-GRILL_HALF_DEPTH_M, GRILL_HALF_DEPTH_M):
        for y_m in (-GRILL_HALF_WIDTH_M, GRILL_HALF_WIDTH_M):
            foot_at_m = np.array([0.9 * x_m, 0.9 * y_m, FEET_M / 2 - GRILL_HEIGHT_M])
            grill.cylinder(0.010, FEET_M / 2, "grey", at_m=foot_at_m)
    for y_m in np.linspace(-0.95, 0.95, NUM_BARS) * GRILL_HALF_WIDTH_M:
        grill.box((GRILL_HALF_DEPTH_M, BAR_RADIUS_M, BAR_RADIUS_M), "grey", at_m=[0, y_m, -BAR_RADIUS_M])


def _add_meat(meat: SceneBody, color: str) -> None:
    third_kg = MEAT_MASS_KG / 3
    meat.box((MEAT_HALF_LENGTH_M, MEAT_HALF_WIDTH_M, MEAT_HALF_HEIGHT_M - SUNK_M), color, mass_kg=third_kg)
    for x_m in (-MEAT_HALF_LENGTH_M, MEAT_HALF_LENGTH_M):
        meat.cylinder(MEAT_HALF_WIDTH_M, MEAT_HALF_HEIGHT_M, color, at_m=[x_m, 0, 0], mass_kg=third_kg)


# The bottle, along z from the point of its neck where it is grasped
BOTTLE_RADIUS_M, NECK_RADIUS_M = 0.025, 0.012
BOTTOM_M, SHOULDER_M, CORK_M = -0.170, -0.050, 0.035
BODY_MIDDLE_M = (BOTTOM_M + SHOULDER_M) / 2
BOTTLE_KG, SHOULDER_KG, NECK_KG = 0.16, 0.02, 0.02
# The rack: two rails across the bottles, with pegs between its three places
RAIL_X_M, RAIL_HALF_M = 0.04, (0.008, 0.13, 0.03)
PEG_HALF_M, PEG_HEIGHT_M = 0.008, 0.012  # on edge, so that a bottle slides off
PEGS_Y_M = (-0.12, -0.04, 0.04, 0.12)
TILT_RAD = 0.80  # of the tool at the neck: keeps the hand off the table and the bottle's top out of its palm
GRASP_YAW_RAD = np.pi / 2
CLEARANCE_M = 0.12
DROP_M = 0.008
RACK_FACING_RAD, RACK_MAX_TURN_RAD = np.pi / 2, np.pi / 4
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
    instruction = "stack the wine bottle to the middle of the rack"

    def build(self, random: np.random.Generator) -> None:
        middle = random.uniform((0.12, -0.24), (0.28, -0.08))
        turn = about_z(RACK_FACING_RAD + random.uniform(-RACK_MAX_TURN_RAD, RACK_MAX_TURN_RAD))
        _add_rails(self.add_part("rack", [*middle, TABLE_TOP_M + 2 * RAIL_HALF_M[2]], turn))
        spot = random.uniform((0.05, 0.08), (0.25, 0.28))
        _add_glass(self.add_part("wine bottle", [*spot, TABLE_TOP_M - BOTTOM_M], free=True))

    def expert(self) -> list[Move]:
        """The tool turns by 90 degrees about the axis of its fingers, so that the bottle it holds comes to lie."""
        grasp = tool_down(GRASP_YAW_RAD, TILT_RAD)
        release = tool_down(self.yaw_rad("rack"), TILT_RAD - np.pi / 2)
        lying_m = self.body_to_world("rack", [-BODY_MIDDLE_M, 0, BOTTLE_RADIUS_M + DROP_M])
        return [
            *pick(self.position_m("wine bottle"), grasp, CLEARANCE_M),
            *place(lying_m, release, CLEARANCE_M, straight=True),
        ]

    def succeeded(self) -> bool:
        to_rack, bottle = self.rotation("rack").inv(), self.rotation("wine bottle")
        x, y, z = self.world_to_body("rack", self.body_to_world("wine bottle", [0, 0, BODY_MIDDLE_M]))
        along_rack = abs(to_rack.apply(bottle.apply([0, 0, 1]))[0]) > MIN_COSINE
        lies = along_rack and abs(z - BOTTLE_RADIUS_M) < MAX_HEIGHT_ERROR_M
        in_middle = abs(x) < MAX_ALONG_M and abs(y) < MAX_ACROSS_M
        return bool(lies and in_middle) and self.gripper_holds_nothing()


def _add_rails(rack: SceneBody) -> None:
    on_edge = Rotation.from_euler("x", np.pi / 4)
    for x_m in (-RAIL_X_M, RAIL_X_M):
        rack.box(RAIL_HALF_M, "wood", at_m=[x_m, 0, -RAIL_HALF_M[2]])
        for y_m in PEGS_Y_M:
            rack.box((PEG_HALF_M,) * 3, "wood", at_m=[x_m, y_m, PEG_HEIGHT_M], rotation=on_edge)


def _add_glass(bottle: SceneBody) -> None:
    half_body, half_neck = (SHOULDER_M - BOTTOM_M) / 2, (CORK_M - SHOULDER_M) / 2
    bottle.cylinder(BOTTLE_RADIUS_M, half_body, "purple", at_m=[0, 0, BODY_MIDDLE_M], mass_kg=BOTTLE_KG)
    bottle.sphere(BOTTLE_RADIUS_M, "purple", at_m=[0, 0, SHOULDER_M], mass_kg=SHOULDER_KG)
    bottle.cylinder(NECK_RADIUS_M, half_neck, "purple", at_m=[0, 0, SHOULDER_M + half_neck], mass_kg=NECK_KG)


PIPE_HALF_M = (0.025, 0.115, 0.025)
SPOUT_RADIUS_M, SPOUT_HEIGHT_M, SPOUT_REACH_M = 0.013, 0.095, 0.10
HANDLES = {"left tap": (0.09, "red"), "right tap": (-0.09, "blue")}  # y along the pipe, color
# A handle is a bar across a stem; its center is the origin of the handle's body
BAR_HALF_M = (0.036, 0.009, 0.012)
BAR_HEIGHT_M = 0.11
STEM_RADIUS_M = 0.009
TAP_MAX_TURN_RAD = np.radians(150.0)
TURNED_RAD = np.pi / 2  # paper, appendix
TURN_STEP_RAD = np.radians(55.0)  # two of these; the grasp may be off by half a bin of 5 degrees at either end
OVER_TAP_M = 0.10


class TurnTap(SimTask):
    """A tap with two handles on the table, at x 0.12..0.30 m, y -0.15..0.15 m, turned by any angle as in RLBench.

    To someone who faces the spout the left handle is the red one. Its pose is the center of its bar, x along the bar.
    Success: the left handle has been turned by 90 degrees.
    """

    name = "turn_tap"
    object_names = ("left tap",)
    yaw_symmetry_deg = dict.fromkeys(object_names, 180.0)
    instruction = "turn left tap"

    def build(self, random: np.random.Generator) -> None:
        point = random.uniform((0.12, -0.15), (0.30, 0.15))
        tap = self.add_part("tap", [*point, TABLE_TOP_M], about_z(random.uniform(-np.pi, np.pi)))
        tap.box(PIPE_HALF_M, "grey", at_m=[0, 0, PIPE_HALF_M[2]])
        tap.cylinder(SPOUT_RADIUS_M, SPOUT_HEIGHT_M / 2, "grey", at_m=[0, 0, SPOUT_HEIGHT_M / 2])
        forward = Rotation.from_euler("y", np.pi / 2)
        spout_m = [-SPOUT_REACH_M / 2, 0, SPOUT_HEIGHT_M]
        tap.capsule(SPOUT_RADIUS_M, SPOUT_REACH_M / 2, "grey", at_m=spout_m, rotation=forward)
        tap.cylinder(SPOUT_RADIUS_M, 0.012, "grey", at_m=[-SPOUT_REACH_M, 0, SPOUT_HEIGHT_M - 0.012])
        for name, (y_m, color) in HANDLES.items():
            handle = self.add_part(name, [0, y_m, BAR_HEIGHT_M], parent=tap).box(BAR_HALF_M, color)
            stem_m = BAR_HEIGHT_M - 2 * PIPE_HALF_M[2] - BAR_HALF_M[2]
            handle.cylinder(STEM_RADIUS_M, stem_m / 2, "grey", at_m=[0, 0, -BAR_HALF_M[2] - stem_m / 2])
            handle.hinge(name, (0, 0, 1), (-0.05, TAP_MAX_TURN_RAD), dry_friction_nm=0.05)

    def expert(self) -> list[Move]:
        bar = self.position_m("left tap")
        yaw_rad = self.nearest_yaw_rad("left tap")
        before, between, after = (tool_down(yaw_rad + steps * TURN_STEP_RAD) for steps in range(3))
        return [
            move_to(bar + OVER_TAP_M * UP, before, gripper_open=True, straight=False),
            move_to(bar, before, gripper_open=False),
            move_to(bar, between, gripper_open=False),
            move_to(bar, after, gripper_open=True),
            move_to(bar + OVER_TAP_M * UP, after, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        return self.joint_position("left tap") >= TURNED_RAD
