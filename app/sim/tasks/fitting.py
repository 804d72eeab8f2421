"""Things that fit into others: `close_jar` and `screw_bulb` turn them there, `sort_shape` finds the right hole."""

import numpy as np

from app.sim.moves import UP, Move, carry, move_to, nearest_yaw_rad, pick, tool_down
from app.sim.scene import SceneBody, about_z, scatter
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


SHAPE_HALF_M, SHAPE_KG = 0.020, 0.05
GRASP_M = 0.010  # above the cube's center
# The sorter's origin is the center of its square hole, in the upper face of its lid
HALF_WIDTH_M, HEIGHT_M, LID_M = 0.09, 0.064, 0.004
MIDDLE_M = np.array([0.035, 0.035, 0.0])  # of the lid
HOLE_HALF_M = 0.029
BAR_HOLE_M, CYLINDER_HOLE_M, PAINT_M = (0.035, 0.085, 0.0), (0.08, 0.015, 0.0), 0.0002
DROP_M, OVER_SORTER_M = 0.002, 0.12


class SortShape(SimTask):
    """A cube, a cylinder and a bar around a box whose lid has a hole for the cube, all turned at random.

    The box's middle is in x 0.18..0.30 m, y -0.10..0.10 m, the shapes at least 19 cm from it in x 0.02..0.38 m,
    y -0.36..0.36 m. The cube's pose is its center. The sorter's pose is the center of its square hole, a quarter turn
    about which changes nothing for the cube. Success: the cube is in the box below the square hole's rim, where no
    other opening lets it in, and the gripper holds nothing.
    """

    name = "sort_shape"
    object_names = ("cube", "shape sorter")
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    instruction = "put the cube in the shape sorter"

    def build(self, random: np.random.Generator) -> None:
        middle = random.uniform((0.18, -0.10), (0.30, 0.10))
        turn = about_z(random.uniform(-np.pi, np.pi))
        hole_m = np.array([*middle, TABLE_TOP_M + HEIGHT_M]) - turn.apply(MIDDLE_M)
        _add_sorter(self.add_part("shape sorter", hole_m, turn))
        low_m, high_m = (0.02, -0.36), (0.38, 0.36)
        points = scatter(random, 3, low_m, high_m, min_distance_m=0.10, clear_of=[(middle, 0.19)])
        cube, cylinder, bar = (
            self.add_part(name, [*point, TABLE_TOP_M + SHAPE_HALF_M], about_z(random.uniform(-np.pi, np.pi)), free=True)
            for name, point in zip(("cube", "cylinder", "bar"), points, strict=True)
        )
        cube.box((SHAPE_HALF_M,) * 3, "red", mass_kg=SHAPE_KG)
        cylinder.cylinder(SHAPE_HALF_M, SHAPE_HALF_M, "blue", mass_kg=SHAPE_KG)
        bar.box((2 * SHAPE_HALF_M, SHAPE_HALF_M / 2, SHAPE_HALF_M), "green", mass_kg=SHAPE_KG)

    def expert(self) -> list[Move]:
        at = self.position_m("cube") + GRASP_M * UP
        in_hole = self.position_m("shape sorter") + (SHAPE_HALF_M + DROP_M + GRASP_M) * UP
        return carry([(at, self.tool_over("cube"), in_hole, self.tool_over("shape sorter"))], OVER_SORTER_M)

    def succeeded(self) -> bool:
        offset = self.world_to_body("shape sorter", self.position_m("cube"))
        in_box = np.abs((offset - MIDDLE_M)[:2]).max() < HALF_WIDTH_M and -HEIGHT_M < offset[2] < -SHAPE_HALF_M
        return bool(in_box) and self.gripper_holds_nothing()


def _add_sorter(sorter: SceneBody) -> None:
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        half_sizes_m = (LID_M if x else HALF_WIDTH_M, LID_M if y else HALF_WIDTH_M, (HEIGHT_M - LID_M) / 2)
        at_m = MIDDLE_M + HALF_WIDTH_M * np.array([x, y, 0]) - (HEIGHT_M + LID_M) / 2 * UP
        sorter.box(half_sizes_m, "wood", at_m=at_m)
    low_m, high_m = MIDDLE_M[0] - HALF_WIDTH_M, MIDDLE_M[0] + HALF_WIDTH_M
    _add_lid(sorter, (low_m, -HOLE_HALF_M), (low_m, high_m))
    _add_lid(sorter, (HOLE_HALF_M, high_m), (low_m, high_m))
    _add_lid(sorter, (-HOLE_HALF_M, HOLE_HALF_M), (low_m, -HOLE_HALF_M))
    _add_lid(sorter, (-HOLE_HALF_M, HOLE_HALF_M), (HOLE_HALF_M, high_m))
    # The other shapes' holes are only painted on
    sorter.mark((2 * SHAPE_HALF_M, SHAPE_HALF_M / 2, PAINT_M), "black", at_m=BAR_HOLE_M)
    sorter.cylinder(SHAPE_HALF_M, PAINT_M, "black", at_m=CYLINDER_HOLE_M)


def _add_lid(sorter: SceneBody, x_m: tuple[float, float], y_m: tuple[float, float]) -> None:
    """The part of the lid between two limits along x and two along y."""
    (x_low, x_high), (y_low, y_high) = x_m, y_m
    center_m = [(x_low + x_high) / 2, (y_low + y_high) / 2, -LID_M / 2]
    sorter.box(((x_high - x_low) / 2, (y_high - y_low) / 2, LID_M / 2), "yellow", at_m=center_m)
