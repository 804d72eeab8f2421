"""Lids and bulbs that are put on and turned: `close_jar` and `screw_bulb`."""

import numpy as np

from app.sim.moves import UP, Move, move_to, nearest_yaw_rad, pick, tool_down
from app.sim.scene import SceneBody, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

CLEARANCE_M = 0.10


def _turn(above_m: Array, seat_m: Array, turn_rad: float, within_m: float) -> list[Move]:
    """Put what is held onto its seat, turn it from `turn_rad` to as much the other way, let go and rise."""
    start, end = tool_down(turn_rad), tool_down(-turn_rad)
    return [
        move_to(above_m, start, gripper_open=False, straight=False),
        move_to(seat_m, start, gripper_open=False, within_m=within_m),
        move_to(seat_m, end, gripper_open=True),
        move_to(above_m, end, gripper_open=True),
    ]


OTHER_COLORS = ("blue", "purple", "green", "orange")
JAR_HEIGHT_M, JAR_RADIUS_M, GLASS_M = 0.08, 0.034, 0.006
# The lid is a disc with a plug beneath it; its origin is the disc's center
LID_RADIUS_M, LID_HALF_HEIGHT_M = 0.033, 0.010
PLUG_RADIUS_M, PLUG_HALF_HEIGHT_M = 0.020, 0.005
LIFTED_M = 2 * PLUG_HALF_HEIGHT_M  # the lid's height on the table, so that it stands on its plug
RELEASE_M = 0.002  # above the rim
LID_TURN_RAD = np.pi / 4  # from this to as much the other way
JARS_APART_M = 0.16  # a jar hides no more than a part of the lid from the front camera
LID_OFFSET_M, LID_HEIGHT_ERROR_M, LID_UPRIGHT = 0.012, 0.004, 0.98


class CloseJar(SimTask):
    """A red jar, one of another color and a lid, at least 16 cm apart in x 0.05..0.36 m, y -0.25..0.25 m.

    All are round, so that RLBench's turns of up to 108 degrees mean nothing here. The jar's pose is the center of its
    rim, the lid's the center of its disc. Success: the lid lies on the red jar and the gripper holds nothing.
    """

    name = "close_jar"
    object_names = ("lid", "red jar")
    yaw_symmetry_deg = dict.fromkeys(object_names, 0.0)
    instruction = "close the red jar"

    def build(self, random: np.random.Generator) -> None:
        lid_at, red_at, other_at = scatter(random, 3, (0.05, -0.25), (0.36, 0.25), JARS_APART_M)
        lid = self.add_part("lid", [*lid_at, TABLE_TOP_M + LIFTED_M + LID_HALF_HEIGHT_M], free=True)
        lid.cylinder(LID_RADIUS_M, LID_HALF_HEIGHT_M, "grey", mass_kg=0.05)
        plug_at_m = [0, 0, -LID_HALF_HEIGHT_M - PLUG_HALF_HEIGHT_M]
        lid.cylinder(PLUG_RADIUS_M, PLUG_HALF_HEIGHT_M, "grey", at_m=plug_at_m, mass_kg=0.02)
        for color, at in (("red", red_at), (random.choice(OTHER_COLORS), other_at)):
            jar = self.add_part(f"{color} jar", [*at, TABLE_TOP_M + JAR_HEIGHT_M])
            jar.wall(color, bottom_m=-JAR_HEIGHT_M, top_m=0, bottom_radius_m=JAR_RADIUS_M, thickness_m=GLASS_M)
            jar.cylinder(JAR_RADIUS_M, 0.004, color, at_m=[0, 0, 0.004 - JAR_HEIGHT_M])

    def expert(self) -> list[Move]:
        on_rim = self.position_m("red jar") + (LID_HALF_HEIGHT_M + RELEASE_M) * UP
        above = on_rim + CLEARANCE_M * UP
        return pick(self.position_m("lid"), tool_down(), CLEARANCE_M) + _turn(above, on_rim, LID_TURN_RAD, RELEASE_M)

    def succeeded(self) -> bool:
        x, y, z = self.position_m("lid") - self.position_m("red jar")
        upright = self.rotation("lid").apply(UP)[2] > LID_UPRIGHT
        closes_it = np.hypot(x, y) < LID_OFFSET_M and abs(z - LID_HALF_HEIGHT_M) < LID_HEIGHT_ERROR_M and upright
        return bool(closes_it) and self.gripper_holds_nothing()


# A bulb's origin is the middle of its glass's neck, where it is gripped; its thread is below
GLASS_RADIUS_M, GLASS_HALF_HEIGHT_M = 0.024, 0.016
THREAD_RADIUS_M, THREAD_M = 0.012, 0.050
BULB_HEIGHT_M = THREAD_M + GLASS_HALF_HEIGHT_M  # of the origin above the thread's end
HOLDER_BASE_M, HOLDER_HEIGHT_M, HOLDER_RADIUS_M = 0.008, 0.024, 0.018
# The lamp's origin is the center of its rim; below are a funnel, a socket and a base
FUNNEL_M, SOCKET_M, LAMP_BASE_M = 0.014, 0.028, 0.020
RIM_RADIUS_M, SOCKET_RADIUS_M, LAMP_RADIUS_M = 0.034, 0.019, 0.055
WALL_M = 0.004
SEATED_M = BULB_HEIGHT_M - FUNNEL_M - SOCKET_M  # the bulb's height above the lamp's when its thread is all the way in
PRESS_M = 0.004  # pushed down by this much more while it is turned
BULB_TURN_RAD = np.radians(60.0)  # from this to as much the other way: clockwise
SEAT_OFFSET_M, SEAT_HEIGHT_ERROR_M, BULB_UPRIGHT = 0.010, 0.005, 0.95
SCREWED_RAD = np.radians(60.0)


class ScrewBulb(SimTask):
    """A red and a blue bulb in holders and a lamp, at least 15 cm apart in x 0.06..0.36 m, y -0.25..0.25 m.

    Bulb and lamp are round: turns mean nothing here. A bulb's pose is the middle of the lower part of its glass, the
    lamp's the center of its rim. Success: the red bulb stands in the lamp's socket, has been turned clockwise there by
    60 degrees or more, and the gripper holds nothing.
    """

    name = "screw_bulb"
    object_names = ("red light bulb", "lamp")
    yaw_symmetry_deg = dict.fromkeys(object_names, 0.0)
    instruction = "screw the red light bulb into the lamp"

    def build(self, random: np.random.Generator) -> None:
        red_at, blue_at, lamp_at = scatter(random, 3, (0.06, -0.25), (0.36, 0.25), min_distance_m=0.15)
        for color, at in (("red", red_at), ("blue", blue_at)):
            _add_holder(self.add_part(f"{color} holder", [*at, TABLE_TOP_M]))
            height_m = TABLE_TOP_M + HOLDER_BASE_M + BULB_HEIGHT_M
            _add_bulb(self.add_part(f"{color} light bulb", [*at, height_m], free=True), color)
        _add_lamp(self.add_part("lamp", [*lamp_at, TABLE_TOP_M + LAMP_BASE_M + SOCKET_M + FUNNEL_M]))

    def after_reset(self) -> None:
        self._seated_yaw_rad: float | None = None
        self._turned_rad = 0.0
        bulb = self.data.body("red light bulb")
        self._bulb_m, self._bulb_axes = bulb.xpos, bulb.xmat  # live views: looking them up in every step takes long
        self._seat_m = self.position_m("lamp") + SEATED_M * UP

    def latch(self) -> None:
        yaw_rad = self.yaw_rad("red light bulb") if self._is_seated() else None
        if yaw_rad is not None and self._seated_yaw_rad is not None:
            self._turned_rad += nearest_yaw_rad(yaw_rad - self._seated_yaw_rad, 2 * np.pi)
        self._seated_yaw_rad = yaw_rad

    def expert(self) -> list[Move]:
        seated = self.position_m("lamp") + SEATED_M * UP
        above, pressed = seated + CLEARANCE_M * UP, seated - PRESS_M * UP
        taken = pick(self.position_m("red light bulb"), tool_down(), CLEARANCE_M)
        return taken + _turn(above, pressed, BULB_TURN_RAD, PRESS_M / 2)

    def succeeded(self) -> bool:
        return self._is_seated() and self._turned_rad < -SCREWED_RAD and self.gripper_holds_nothing()

    def _is_seated(self) -> bool:
        x, y, z = self._bulb_m - self._seat_m
        in_place = abs(z) < SEAT_HEIGHT_ERROR_M and np.hypot(x, y) < SEAT_OFFSET_M
        return bool(in_place and self._bulb_axes[8] > BULB_UPRIGHT)


def _add_holder(holder: SceneBody) -> None:
    holder.box((0.030, 0.030, HOLDER_BASE_M / 2), "wood", at_m=[0, 0, HOLDER_BASE_M / 2])
    top_m = HOLDER_BASE_M + HOLDER_HEIGHT_M
    holder.wall(
        "wood", bottom_m=HOLDER_BASE_M, top_m=top_m, bottom_radius_m=HOLDER_RADIUS_M, thickness_m=WALL_M, facets=10
    )


def _add_bulb(bulb: SceneBody, color: str) -> None:
    thread_at_m = [0, 0, -GLASS_HALF_HEIGHT_M - THREAD_M / 2]
    bulb.cylinder(THREAD_RADIUS_M, THREAD_M / 2, "grey", at_m=thread_at_m, mass_kg=0.022)
    bulb.cylinder(GLASS_RADIUS_M, GLASS_HALF_HEIGHT_M, color, mass_kg=0.015)
    bulb.sphere(GLASS_RADIUS_M, color, at_m=[0, 0, GLASS_HALF_HEIGHT_M], mass_kg=0.01)


def _add_lamp(lamp: SceneBody) -> None:
    floor_m = -FUNNEL_M - SOCKET_M
    lamp.cylinder(LAMP_RADIUS_M, LAMP_BASE_M / 2, "black", at_m=[0, 0, floor_m - LAMP_BASE_M / 2])
    lamp.wall("black", bottom_m=floor_m, top_m=-FUNNEL_M, bottom_radius_m=SOCKET_RADIUS_M, thickness_m=WALL_M)
    lamp.wall(
        "grey",
        bottom_m=-FUNNEL_M,
        top_m=0,
        bottom_radius_m=SOCKET_RADIUS_M,
        top_radius_m=RIM_RADIUS_M,
        thickness_m=WALL_M,
    )
