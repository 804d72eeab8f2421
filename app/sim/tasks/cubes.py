"""Cubes that are stacked and unstacked: `stack_cube`, `destack_cube`, `stack_blocks` and `build_tower`."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from app.sim.moves import UP, Move, carry, pick, place, tool_down
from app.sim.scene import COLORS, about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

HALF_SIZE_M = 0.025
BLOCK_HALF_M = 0.022
MAX_HEIGHT_ERROR_M = 0.008
MAX_OFFSET_M = 0.03  # of a cube from the middle of what it stands on
PAD_HALF_M, PAD_HALF_HEIGHT_M = 0.05, 0.001


class CubeTask(SimTask):
    """Cubes of one size on the table, each of the color in its name. A cube's pose is its center."""

    half_m: ClassVar[float] = HALF_SIZE_M
    mass_kg: ClassVar[float] = 0.09

    def add_cube_over(self, point_m: Array, name: str, yaw_rad: float, storey: int = 0, color: str = "") -> None:
        """A cube over a point (2,) of the table, on `storey` others; for use in `build`."""
        height_m = TABLE_TOP_M + (2 * storey + 1) * self.half_m
        color = color or _color(name)
        self.add_cube(name, color, [*point_m, height_m], self.half_m, yaw_rad, mass_kg=self.mass_kg)

    def add_cubes(self, random: np.random.Generator, points_m: Mapping[str, Array]) -> None:
        """Cubes over points (2,) of the table, turned at random; for use in `build`."""
        for name, point_m in points_m.items():
            self.add_cube_over(point_m, name, random.uniform(-np.pi, np.pi))

    def add_pad(self, random: np.random.Generator, name: str, point_m: Array) -> None:
        """A square on the table, turned at random, its center at a point (2,); for use in `build`."""
        pad = self.add_part(name, [*point_m, TABLE_TOP_M + PAD_HALF_HEIGHT_M], about_z(random.uniform(-np.pi, np.pi)))
        pad.mark((PAD_HALF_M, PAD_HALF_M, PAD_HALF_HEIGHT_M), _color(name))

    def on_table(self, cube: str) -> bool:
        """Whether a cube lies flat on the table."""
        return bool(abs(self.position_m(cube)[2] - TABLE_TOP_M - self.half_m) < MAX_HEIGHT_ERROR_M)


def _color(name: str) -> str:
    return next(word for word in name.split() if word in COLORS)


class BlockTask(CubeTask):
    """A composition with 4.4 cm blocks."""

    half_m = BLOCK_HALF_M
    mass_kg = 0.07


class TwoCubes(CubeTask):
    """Two 5 cm cubes, blue and yellow, of which the instruction names one as the upper."""

    object_names = ("blue cube", "yellow cube")
    variations = 2
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    drop_m = 0.004  # a cube is released this far above what it shall rest on

    @property
    def upper_and_lower(self) -> tuple[str, str]:
        """Which cube the instruction calls the one on top, and the other."""
        blue, yellow = self.object_names
        return (blue, yellow) if self.variation == 0 else (yellow, blue)


class StackCube(TwoCubes):
    """Two 5 cm cubes on the table, centers at least 11 cm apart, in x 0.05..0.38 m, y -0.28..0.28 m, turned at random.

    A cube's pose is its center. Success: the right cube rests on the other and the gripper holds nothing.
    """

    name = "stack_cube"
    clearances_m = (0.10, 0.16)  # by way: how high the cube is carried
    ways = len(clearances_m)

    def build(self, random: np.random.Generator) -> None:
        points = scatter(random, 2, (0.05, -0.28), (0.38, 0.28), min_distance_m=0.11)
        self.add_cubes(random, dict(zip(self.object_names, points, strict=True)))

    @property
    def instruction(self) -> str:
        upper, lower = self.upper_and_lower
        return f"stack the {upper} on the {lower}."

    def expert(self) -> list[Move]:
        upper, lower = self.upper_and_lower
        on_top = self.position_m(lower) + (2 * self.half_m + self.drop_m) * UP
        return carry([(*self.grasp(upper), on_top, self.tool_over(lower))], self.clearances_m[self.way])

    def succeeded(self) -> bool:
        upper, lower = self.upper_and_lower
        x, y, z = self.position_m(upper) - self.position_m(lower)
        rests_on_it = np.hypot(x, y) < MAX_OFFSET_M and abs(z - 2 * self.half_m) < MAX_HEIGHT_ERROR_M
        return bool(rests_on_it) and self.gripper_holds_nothing()


class DestackCube(TwoCubes):
    """Two 5 cm cubes, one on the other, in x 0.10..0.36 m, y -0.12..0.26 m, turned at random, up to 11 degrees apart.

    The range leaves room on the table to the right. A cube's pose is its center. Success: the upper cube has landed on
    the table and the gripper holds nothing.
    """

    name = "destack_cube"
    ways = 2  # the fingers on one pair of the cube's faces or on the other
    max_twist_rad = 0.2  # between the two cubes
    aside_m = 0.15  # along the upper cube's -y, i.e. to the robot's right

    def build(self, random: np.random.Generator) -> None:
        upper, lower = self.upper_and_lower
        point = random.uniform((0.10, -0.12), (0.36, 0.26))
        yaw_rad = random.uniform(-np.pi, np.pi)
        twist_rad = random.uniform(-self.max_twist_rad, self.max_twist_rad)
        self.add_cube_over(point, lower, yaw_rad)
        self.add_cube_over(point, upper, yaw_rad + twist_rad, storey=1)

    @property
    def instruction(self) -> str:
        upper, lower = self.upper_and_lower
        return f"destack the {upper} that is on the {lower}."

    def expert(self) -> list[Move]:
        upper, _ = self.upper_and_lower
        yaw_rad = self.nearest_yaw_rad(upper)
        quarter_turn_rad = -np.copysign(np.pi / 2, yaw_rad) * self.way
        grasp, at = tool_down(yaw_rad + quarter_turn_rad), self.position_m(upper)
        aside = at + about_z(yaw_rad).apply([0, -self.aside_m, 0]) + (self.drop_m - 2 * self.half_m) * UP
        return pick(at, grasp) + place(aside, grasp)

    def succeeded(self) -> bool:
        upper, _ = self.upper_and_lower
        return self.on_table(upper) and self.gripper_holds_nothing()


class StackBlocks(CubeTask):
    """Four red and two blue 4.8 cm blocks about a green platform, each turned at random, at least 10.5 cm apart.

    Blocks lie in x 0.02..0.38 m, y -0.33..0.33 m, the platform in x 0.10..0.30 m, y -0.10..0.10 m. Poses are centers.
    The red blocks are numbered by their distance from the platform. Success: two red blocks or more, whichever they
    are, are inside the platform's area and the gripper holds nothing.
    """

    name = "stack_blocks"
    half_m = 0.024
    mass_kg = 0.08
    clearances_m = (0.10, 0.15)  # by way: how high blocks are carried
    ways = len(clearances_m)
    red_blocks = ("first red block", "second red block", "third red block", "fourth red block")
    blue_blocks = ("first blue block", "second blue block")
    to_stack = red_blocks[:2]
    object_names = (*to_stack, "green platform")
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    min_distance_m = 0.105
    drop_m = 0.005  # released this far above what is below
    instruction = "stack 2 red blocks on the green platform"

    def build(self, random: np.random.Generator) -> None:
        center = random.uniform((0.10, -0.10), (0.30, 0.10))
        self.add_pad(random, "green platform", center)
        names, apart_m = (*self.red_blocks, *self.blue_blocks), self.min_distance_m
        points = scatter(random, len(names), (0.02, -0.33), (0.38, 0.33), apart_m, clear_of=[(center, apart_m)])
        red = sorted(points[: len(self.red_blocks)], key=lambda point: float(np.linalg.norm(point - center)))
        self.add_cubes(random, dict(zip(names, (*red, *points[len(red) :]), strict=True)))

    def expert(self) -> list[Move]:
        foot = self.position_m("green platform") + (PAD_HALF_HEIGHT_M + self.half_m + self.drop_m) * UP
        release = self.tool_over("green platform")
        heights = enumerate(self.to_stack)
        trips = [(*self.grasp(block), foot + 2 * self.half_m * storey * UP, release) for storey, block in heights]
        return carry(trips, self.clearances_m[self.way])

    def succeeded(self) -> bool:
        offsets = [self.world_to_body("green platform", self.position_m(block)) for block in self.red_blocks]
        inside = sum(np.abs(offset[:2]).max() < PAD_HALF_M for offset in offsets)
        return bool(inside >= len(self.to_stack)) and self.gripper_holds_nothing()


class BuildTower(BlockTask):
    """Four 4.4 cm blocks about a white plate, each turned at random; poses are centers.

    Blocks lie in x 0.02..0.38 m, y -0.33..0.33 m, the plate in x 0.12..0.30 m, y -0.10..0.10 m. Demonstrated are towers
    of one, two and four blocks, asked for is one of three. Success: so many blocks, whichever they are, stand on each
    other on the plate, the others lie beside it, and the gripper holds nothing.
    """

    name = "build_tower"
    SHOWN, ASKED = (1, 2, 4), (3,)  # numbers of blocks
    blocks = ("red block", "green block", "blue block", "yellow block")
    object_names = (*blocks, "white plate")
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    drop_m = 0.004  # a block is released this far above what it shall rest on

    @property
    def height(self) -> int:
        """How many blocks the tower shall have."""
        return int(self.combination)

    def build(self, random: np.random.Generator) -> None:
        center = random.uniform((0.12, -0.10), (0.30, 0.10))
        self.add_pad(random, "white plate", center)
        low_m, high_m = (0.02, -0.33), (0.38, 0.33)
        points = scatter(random, len(self.blocks), low_m, high_m, min_distance_m=0.105, clear_of=[(center, 0.13)])
        self.add_cubes(random, dict(zip(self.blocks, points, strict=True)))

    @property
    def instruction(self) -> str:
        return f"build a tower {self.height} high on the white plate"

    def expert(self) -> list[Move]:
        foot = self.position_m("white plate") + (self.half_m - PAD_HALF_HEIGHT_M + self.drop_m) * UP
        release = self.tool_over("white plate")
        heights = enumerate(self.blocks[: self.height])
        trips = [(*self.grasp(block), foot + 2 * self.half_m * storey * UP, release) for storey, block in heights]
        return carry(trips, straight=True)

    def succeeded(self) -> bool:
        offsets = np.array([self.position_m(block) - self.position_m("white plate") for block in self.blocks])
        stacked = np.hypot(offsets[:, 0], offsets[:, 1]) < MAX_OFFSET_M
        expected_m = self.half_m * (2 * np.arange(self.height) + 1)
        heights_m = np.sort(offsets[stacked, 2] + PAD_HALF_HEIGHT_M)
        if len(heights_m) != self.height or np.abs(heights_m - expected_m).max() > MAX_HEIGHT_ERROR_M:
            return False
        aside = [block for block, in_tower in zip(self.blocks, stacked, strict=True) if not in_tower]
        return all(map(self.on_table, aside)) and self.gripper_holds_nothing()
