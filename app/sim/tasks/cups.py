"""Cups: `place_cups` hangs one by its handle on a holder, `stack_cups` puts two into a third."""

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.moves import UP, Move, carry, move_to, pick, tool_down
from app.sim.scene import SceneBody, about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

# A cup, around the point on its axis where it is grasped; its handle is on the side of x
CUP_RADIUS_M, CUP_WALL_M, CUP_HEIGHT_M, GRASP_HEIGHT_M = 0.033, 0.003, 0.080, 0.066
CUP_WALL_KG, FLOOR_KG, BAR_KG = 0.05, 0.02, 0.004
BAR_HALF_M, BAR_HALF_WIDTH_M = 0.003, 0.004  # of the handle: across its opening, along it
HOLE_M, HOLE_HALF_M = (0.0555, -0.024), (0.021, 0.022)  # the handle's opening, in x and z
COLORS = ("red", "blue", "green")
CUPS_APART_M = 0.17  # handles that face each other do not touch
# The holder: a pole with three spokes, the first towards -x
SPOKE_ANGLES_RAD = np.pi + np.radians([0.0, 120.0, 240.0])
SPOKES_HEIGHT_M, POLE_HEIGHT_M, POLE_RADIUS_M = 0.160, 0.190, 0.010
SPOKE_RADIUS_M, SPOKE_LENGTH_M, SPOKE_RISE_RAD = 0.004, 0.085, 0.12
HANG_M, BEFORE_M = 0.060, 0.125  # of the cup's axis from the pole, along the spoke
BEFORE_WITHIN_M = 0.004  # the handle is in line with the spoke before its tip
LIFT_M, RISE_M = 0.22, 0.10  # lifted so high that the cup passes above the holder
HOLDER_DISTANCE_M = 0.22  # of the cups
CUP_YAW_RAD = np.radians((-30.0, 150.0))


class PlaceCups(SimTask):
    """A cup holder with three spokes and three cups, of which the red one is to hang.

    The holder stands in x 0.20..0.32 m, y -0.20..-0.06 m, turned at random. The cups stand at least 17 cm apart in
    x 0.00..0.34 m, y -0.10..0.34 m, their handles in a range of 180 degrees as in RLBench, -30..150. A cup's pose is
    the point on its axis to grasp it at, x towards the handle. The holder's is on its pole, as high as the spokes
    begin; one spoke points along -x. Success: a spoke passes through the red cup's handle and the gripper holds
    nothing.
    """

    name = "place_cups"
    object_names = ("red cup", "cup holder")
    yaw_symmetry_deg = dict.fromkeys(("cup holder",), 120.0)
    instruction = "place the red cup on the cup holder"

    def build(self, random: np.random.Generator) -> None:
        pole = random.uniform((0.20, -0.20), (0.32, -0.06))
        turn = about_z(random.uniform(-np.pi, np.pi))
        _add_holder(self.add_part("cup holder", [*pole, TABLE_TOP_M + SPOKES_HEIGHT_M], turn))
        clear_of = [(pole, HOLDER_DISTANCE_M)]
        spots = scatter(random, len(COLORS), (0.00, -0.10), (0.34, 0.34), CUPS_APART_M, clear_of)
        for color, spot in zip(COLORS, spots, strict=True):
            turn = about_z(random.uniform(*CUP_YAW_RAD))
            _add_cup(self.add_part(f"{color} cup", [*spot, TABLE_TOP_M + GRASP_HEIGHT_M], turn, free=True), color)

    def expert(self) -> list[Move]:
        """The fingers close across the handle's direction; the handle then slides onto the spoke from its tip."""
        turn = about_z(self.nearest_yaw_rad("cup holder"))
        grasp = tool_down(self.yaw_rad("red cup"))
        hang = turn * tool_down(np.pi / 2)
        hole_x, hole_z = HOLE_M
        pole, height_m = self.position_m("cup holder"), HANG_M * np.tan(SPOKE_RISE_RAD) - hole_z
        before, hanging = (pole + turn.apply([-out_m, -hole_x, height_m]) for out_m in (BEFORE_M, HANG_M))
        return [
            *pick(self.position_m("red cup"), grasp, LIFT_M),
            move_to(before + RISE_M * UP, hang, gripper_open=False),
            move_to(before, hang, gripper_open=False, within_m=BEFORE_WITHIN_M),
            move_to(hanging, hang, gripper_open=True),
            move_to(hanging + RISE_M * UP, hang, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        return any(self._hangs_on(angle_rad) for angle_rad in SPOKE_ANGLES_RAD) and self.gripper_holds_nothing()

    def _hangs_on(self, angle_rad: float) -> bool:
        """Whether a spoke, seen as a line from the pole to its tip, passes through the opening of the handle."""
        ends = self.body_to_world("cup holder", [np.zeros(3), _spoke_tip_m(angle_rad)])
        root, tip = self.world_to_body("red cup", ends)
        if root[1] * tip[1] >= 0:
            return False
        through = root + root[1] / (root[1] - tip[1]) * (tip - root)
        return bool((np.abs(through[[0, 2]] - HOLE_M) < HOLE_HALF_M).all())


def _spoke_tip_m(angle_rad: float) -> Array:
    """The end of a spoke's axis in the holder's frame."""
    tip: Array = SPOKE_LENGTH_M * np.array([np.cos(angle_rad), np.sin(angle_rad), np.tan(SPOKE_RISE_RAD)])
    return tip


def _add_holder(holder: SceneBody) -> None:
    holder.cylinder(0.055, 0.006, "wood", at_m=[0, 0, 0.006 - SPOKES_HEIGHT_M])
    holder.cylinder(POLE_RADIUS_M, POLE_HEIGHT_M / 2, "wood", at_m=[0, 0, POLE_HEIGHT_M / 2 - SPOKES_HEIGHT_M])
    upright = Rotation.from_euler("y", np.pi / 2 - SPOKE_RISE_RAD)
    for angle_rad in SPOKE_ANGLES_RAD:
        tip_m = _spoke_tip_m(angle_rad)
        half_length = float(np.linalg.norm(tip_m)) / 2
        spoke = about_z(angle_rad) * upright
        holder.capsule(SPOKE_RADIUS_M, half_length, "wood", at_m=tip_m / 2, rotation=spoke)


def _add_cup(cup: SceneBody, color: str) -> None:
    bottom_m, top_m = CUP_WALL_M - GRASP_HEIGHT_M, CUP_HEIGHT_M - GRASP_HEIGHT_M
    radius_m, thickness_m = CUP_RADIUS_M, CUP_WALL_M
    cup.wall(
        color, bottom_m=bottom_m, top_m=top_m, bottom_radius_m=radius_m, thickness_m=thickness_m, mass_kg=CUP_WALL_KG
    )
    cup.cylinder(CUP_RADIUS_M, CUP_WALL_M / 2, color, at_m=[0, 0, bottom_m - CUP_WALL_M / 2], mass_kg=FLOOR_KG)
    (hole_x, hole_z), (half_x, half_z), half_bar = HOLE_M, HOLE_HALF_M, BAR_HALF_M
    for z_m in (hole_z - half_z - half_bar, hole_z + half_z + half_bar):
        cup.box(
            (half_x + half_bar, BAR_HALF_WIDTH_M, half_bar), color, at_m=[hole_x + half_bar, 0, z_m], mass_kg=BAR_KG
        )
    outer_m = [hole_x + half_x + half_bar, 0, hole_z]
    cup.box((half_bar, BAR_HALF_WIDTH_M, half_z), color, at_m=outer_m, mass_kg=BAR_KG)


TARGET, OTHERS = "green cup", ("red cup", "blue cup")
# A cup is a cone of facets; its origin is the center of its rim
CONE_HEIGHT_M, BOTTOM_RADIUS_M, RIM_RADIUS_M = 0.085, 0.026, 0.037
CONE_WALL_M, BOTTOM_M = 0.003, 0.004
CONE_WALL_KG, BOTTOM_KG = 0.048, 0.02
WALL_FRICTION = 0.25  # smooth, so that a cup slides into another
# One finger in the cup, one outside: the tool's point is in the wall on the cup's -y side, a little below the rim
ON_WALL_M = np.array([0.0, -0.0355, -0.010])
NESTED_M = 0.022  # how much higher a cup's rim is than that of the cup around it: the walls then touch
RELEASE_M = 0.013  # above that
CLEARANCE_M = 0.14
MAX_OFFSET_M, MIN_UPRIGHT = 0.02, 0.95
LOWEST_M = 0.004  # a cup that is inside another stands this much higher than it, and less than a cup's height


class StackCups(SimTask):
    """A red, a green and a blue cup at least 15 cm apart in x 0.06..0.36 m, y -0.25..0.25 m, not turned, as in RLBench.

    A cup's pose is the center of its rim. Success: the red and the blue cup stand inside the green one and the gripper
    holds nothing.
    """

    name = "stack_cups"
    object_names = (*OTHERS, TARGET)
    yaw_symmetry_deg = dict.fromkeys(object_names, 0.0)
    instruction = "stack the red cup and the blue cup inside the green cup"

    def build(self, random: np.random.Generator) -> None:
        points = scatter(random, len(self.object_names), (0.06, -0.25), (0.36, 0.25), min_distance_m=0.15)
        for name, point in zip(self.object_names, points, strict=True):
            color = name.split()[0]
            cup = self.add_part(name, [*point, TABLE_TOP_M + CONE_HEIGHT_M], free=True)
            bottom_at_m = [0, 0, BOTTOM_M / 2 - CONE_HEIGHT_M]
            cup.cylinder(BOTTOM_RADIUS_M, BOTTOM_M / 2, color, at_m=bottom_at_m, mass_kg=BOTTOM_KG)
            cup.wall(
                color,
                bottom_m=BOTTOM_M - CONE_HEIGHT_M,
                top_m=0,
                bottom_radius_m=BOTTOM_RADIUS_M,
                top_radius_m=RIM_RADIUS_M,
                thickness_m=CONE_WALL_M,
                mass_kg=CONE_WALL_KG,
                friction=WALL_FRICTION,
            )

    def expert(self) -> list[Move]:
        down = tool_down()
        target = self.position_m(TARGET) + ON_WALL_M + RELEASE_M * UP
        trips = [
            (self.position_m(cup) + ON_WALL_M, down, target + cups_below * NESTED_M * UP, down)
            for cups_below, cup in enumerate(OTHERS, start=1)
        ]
        return carry(trips, CLEARANCE_M)

    def succeeded(self) -> bool:
        return all(self._is_inside(cup) for cup in OTHERS) and self.gripper_holds_nothing()

    def _is_inside(self, cup: str) -> bool:
        x, y, z = self.position_m(cup) - self.position_m(TARGET)
        upright = self.rotation(cup).apply(UP)[2] > MIN_UPRIGHT
        return bool(np.hypot(x, y) < MAX_OFFSET_M and LOWEST_M < z < CONE_HEIGHT_M and upright)
