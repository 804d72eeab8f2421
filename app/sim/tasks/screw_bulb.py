"""Take the red light bulb out of its holder and screw it into the lamp."""

import numpy as np

from app.sim.moves import UP, Move, move_to, nearest_yaw_rad, pick, tool_down
from app.sim.scene import Part, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

BULB, LAMP = "red light bulb", "lamp"
# A bulb's origin is the middle of its glass's neck, where it is gripped; its thread is below
GLASS_RADIUS_M, GLASS_HALF_HEIGHT_M = 0.024, 0.016
THREAD_RADIUS_M, THREAD_M = 0.012, 0.050
BULB_HEIGHT_M = THREAD_M + GLASS_HALF_HEIGHT_M  # of the origin above the thread's end
HOLDER_BASE_M, HOLDER_HEIGHT_M, HOLDER_RADIUS_M = 0.008, 0.024, 0.018
# The lamp's origin is the centre of its rim; below are a funnel, a socket and a base
FUNNEL_M, SOCKET_M, LAMP_BASE_M = 0.014, 0.028, 0.020
RIM_RADIUS_M, SOCKET_RADIUS_M, LAMP_RADIUS_M = 0.034, 0.019, 0.055
WALL_M = 0.004
SEATED_M = BULB_HEIGHT_M - FUNNEL_M - SOCKET_M  # the bulb's height above the lamp's when its thread is all the way in
PRESS_M = 0.004  # pushed down by this much more while it is turned
TURN_RAD = np.radians(60.0)  # from this to as much the other way: clockwise
CLEARANCE_M = 0.10
MIN_DISTANCE_M = 0.15
LOW_M, HIGH_M = (0.06, -0.25), (0.36, 0.25)
MAX_OFFSET_M, MAX_HEIGHT_ERROR_M, MIN_UPRIGHT = 0.010, 0.005, 0.95
SCREWED_RAD = np.radians(60.0)


class ScrewBulb(SimTask):
    """A red and a blue bulb in holders and a lamp, at least 15 cm apart in x 0.06..0.36 m, y -0.25..0.25 m.

    Bulb and lamp are round: turns mean nothing here. A bulb's pose is the middle of the lower part of its glass, the
    lamp's the centre of its rim. Success: the red bulb stands in the lamp's socket, has been turned clockwise there by
    60 degrees or more, and the gripper holds nothing.
    """

    name = "screw_bulb"
    object_names = (BULB, LAMP)
    yaw_symmetry_deg = dict.fromkeys(object_names, 0.0)

    def build(self, random: np.random.Generator) -> None:
        red_at, blue_at, lamp_at = scatter(random, 3, LOW_M, HIGH_M, MIN_DISTANCE_M)
        for colour, at in (("red", red_at), ("blue", blue_at)):
            _add_holder(self.add_part(f"{colour} holder", [*at, TABLE_TOP_M]))
            height_m = TABLE_TOP_M + HOLDER_BASE_M + BULB_HEIGHT_M
            _add_bulb(self.add_part(f"{colour} light bulb", [*at, height_m], free=True), colour)
        _add_lamp(self.add_part(LAMP, [*lamp_at, TABLE_TOP_M + LAMP_BASE_M + SOCKET_M + FUNNEL_M]))

    def after_reset(self) -> None:
        self._seated_yaw_rad: float | None = None
        self._turned_rad = 0.0
        bulb = self.data.body(BULB)
        self._bulb_m, self._bulb_axes = bulb.xpos, bulb.xmat  # live views: looking them up in every step takes long
        self._seat_m = self.position_m(LAMP) + SEATED_M * UP

    def latch(self) -> None:
        yaw_rad = self.yaw_rad(BULB) if self._is_seated() else None
        if yaw_rad is not None and self._seated_yaw_rad is not None:
            self._turned_rad += nearest_yaw_rad(yaw_rad - self._seated_yaw_rad, 2 * np.pi)
        self._seated_yaw_rad = yaw_rad

    @property
    def instruction(self) -> str:
        return "screw the red light bulb into the lamp"

    def expert(self) -> list[Move]:
        seated = self.position_m(LAMP) + SEATED_M * UP
        start, end = tool_down(TURN_RAD), tool_down(-TURN_RAD)
        return [
            *pick(self.position_m(BULB), tool_down(), CLEARANCE_M),
            move_to(seated + CLEARANCE_M * UP, start, gripper_open=False, straight=False),
            move_to(seated - PRESS_M * UP, start, gripper_open=False, within_m=PRESS_M / 2),
            move_to(seated - PRESS_M * UP, end, gripper_open=True),
            move_to(seated + CLEARANCE_M * UP, end, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        return self._is_seated() and self._turned_rad < -SCREWED_RAD and self.gripper_holds_nothing()

    def _is_seated(self) -> bool:
        x, y, z = self._bulb_m - self._seat_m
        in_place = abs(z) < MAX_HEIGHT_ERROR_M and np.hypot(x, y) < MAX_OFFSET_M
        return bool(in_place and self._bulb_axes[8] > MIN_UPRIGHT)


def _add_holder(holder: Part) -> None:
    holder.box((0.030, 0.030, HOLDER_BASE_M / 2), "wood", at_m=[0, 0, HOLDER_BASE_M / 2])
    top_m = HOLDER_BASE_M + HOLDER_HEIGHT_M
    holder.wall(
        "wood", bottom_m=HOLDER_BASE_M, top_m=top_m, bottom_radius_m=HOLDER_RADIUS_M, thickness_m=WALL_M, facets=10
    )


def _add_bulb(bulb: Part, colour: str) -> None:
    thread_at_m = [0, 0, -GLASS_HALF_HEIGHT_M - THREAD_M / 2]
    bulb.cylinder(THREAD_RADIUS_M, THREAD_M / 2, "grey", at_m=thread_at_m, mass_kg=0.022)
    bulb.cylinder(GLASS_RADIUS_M, GLASS_HALF_HEIGHT_M, colour, mass_kg=0.015)
    bulb.sphere(GLASS_RADIUS_M, colour, at_m=[0, 0, GLASS_HALF_HEIGHT_M], mass_kg=0.01)


def _add_lamp(lamp: Part) -> None:
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
