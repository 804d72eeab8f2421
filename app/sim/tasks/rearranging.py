"""Blocks and cubes carried to where words and scene ask: `clear_kind`, `place_beside` and `swap_cubes`."""

from collections.abc import Mapping
from itertools import combinations, product
from typing import ClassVar

import numpy as np

from app.sim.moves import UP, Move, carry, pick, place, tool_down
from app.sim.scene import about_z, scatter
from app.sim.tasks.cubes import BLOCK_HALF_M, MAX_OFFSET_M, PAD_HALF_HEIGHT_M, BlockTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

KINDS = {kind: tuple(f"{number} {kind} block" for number in ("first", "second", "third")) for kind in ("red", "blue")}
BLOCKS = KINDS["red"] + KINDS["blue"]
RADIUS_M, WALL_M, FLOOR_HALF_M = 0.125, 0.02, 0.0005
SLOT_RADIUS_M = 0.07  # every block has its place in the tray, a sixth of a turn from the next
ABOVE_SLOT_M = 0.037  # where a block is released: the fingers are above the blocks beside it
LIFTED_M = 0.03
OVER_TRAY_M = 0.12


class ClearKind(BlockTask):
    """A round tray in x 0.14..0.26 m, y -0.18..0.18 m, three red and three blue blocks; poses are centers.

    Some blocks of each color are on the table, in x 0.02..0.38 m, y -0.34..0.34 m, turned at random, the others in the
    tray. Demonstrated are one and two red ones, one and three blue ones on the table; asked for are three red ones, and
    two blue ones. Success: all blocks of the color are in the tray, no other block has been lifted, and the gripper
    holds nothing. `events` are the other blocks that were lifted.
    """

    name = "clear_kind"
    object_names = (*BLOCKS, "tray")
    yaw_symmetry_deg: ClassVar[Mapping[str, float]] = {**dict.fromkeys(BLOCKS, 90.0), "tray": 0.0}
    # The color, and how many blocks of it are on the table; the others are in the tray already
    SHOWN = (("red", 1), ("red", 2), ("blue", 1), ("blue", 3))
    ASKED = (("red", 3), ("blue", 2))

    def build(self, random: np.random.Generator) -> None:
        tray = random.uniform((0.14, -0.18), (0.26, 0.18))
        part = self.add_part("tray", [*tray, TABLE_TOP_M])
        part.cylinder(RADIUS_M, FLOOR_HALF_M, "wood", at_m=[0, 0, FLOOR_HALF_M])
        part.wall("wood", bottom_m=0.0, top_m=WALL_M, bottom_radius_m=RADIUS_M)
        color, number = self.combination
        numbers = {kind: number if kind == color else int(random.integers(1, 3)) for kind in KINDS}
        self._on_table = {
            block: kind
            for kind, blocks in KINDS.items()
            for block in sorted(random.permutation(blocks)[: numbers[kind]])
        }
        low_m, high_m = (0.02, -0.34), (0.38, 0.34)
        points = scatter(random, len(self._on_table), low_m, high_m, min_distance_m=0.095, clear_of=[(tray, 0.175)])
        places = dict(zip(self._on_table, points, strict=True))
        self.add_cubes(random, {block: places.get(block, tray + _slot_m(block)[:2]) for block in BLOCKS})

    @property
    def _to_clear(self) -> list[str]:
        """In the order of their names."""
        return [block for block in BLOCKS if self._on_table.get(block) == self.combination[0]]

    def after_reset(self) -> None:
        self._others = {block: self.model.body(block).id for block in BLOCKS if block not in self._to_clear}

    def latch(self) -> None:
        for block, body in self._others.items():
            if self.data.xpos[body, 2] > TABLE_TOP_M + BLOCK_HALF_M + LIFTED_M and block not in self.events:
                self.events.append(block)

    @property
    def instruction(self) -> str:
        return f"put every {self.combination[0]} block in the tray"

    def expert(self) -> list[Move]:
        tray, height_m = self.position_m("tray"), BLOCK_HALF_M + ABOVE_SLOT_M
        trips = [(*self.grasp(block), tray + _slot_m(block) + height_m * UP, tool_down()) for block in self._to_clear]
        return carry(trips, OVER_TRAY_M, OVER_TRAY_M - ABOVE_SLOT_M, straight=True)

    def succeeded(self) -> bool:
        tray = self.position_m("tray")
        offsets = np.array([self.position_m(block) - tray for block in KINDS[self.combination[0]]])
        inside = (np.hypot(offsets[:, 0], offsets[:, 1]) < RADIUS_M) & (offsets[:, 2] < 2 * BLOCK_HALF_M)
        return bool(inside.all()) and not self.events and self.gripper_holds_nothing()


def _slot_m(block: str) -> Array:
    """(3,) from the tray's center to the block's place in it."""
    slot: Array = about_z(np.pi / 3 * BLOCKS.index(block)).apply([SLOT_RADIUS_M, 0, 0])
    return slot


BLOCK = "red block"
OTHERS = ("blue block", "green block", "yellow block")
BETWEEN = "between"
# Along the world's y axis, which points to the left as the robot sees it
OFFSETS_M = {
    "close to the left of": 0.10,
    "far to the left of": 0.18,
    "close to the right of": -0.10,
    "far to the right of": -0.18,
}
# A relation, and the blocks that it relates to
Relation = tuple[str, tuple[str, ...]]
BLUE, GREEN, YELLOW = ((other,) for other in OTHERS)
REACHED_LOW_M, REACHED_HIGH_M = (0.04, -0.34), (0.36, 0.34)
ROOM_M = 0.095  # from the place that is asked for to any block
MAX_SCENES = 10_000
MAX_PUSH_M = 0.02
BESIDE_DROP_M = 0.004


class PlaceBeside(BlockTask):
    """Four 4.4 cm blocks in x 0.04..0.36 m, y -0.30..0.30 m, at least 11 cm apart; poses are centers.

    Close is 10 cm, far is 18 cm from center to center. Demonstrated are close and far to the left, close to the right,
    and between two of the pairs; asked for are far to the right, and between the third pair. Success: the red block
    lies within 3 cm of its place, the others have not been pushed by 2 cm or more, and the gripper holds nothing.
    """

    name = "place_beside"
    object_names = (BLOCK, *OTHERS)
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    SHOWN: ClassVar[tuple[Relation, ...]] = (
        ("close to the left of", BLUE),
        ("far to the left of", GREEN),
        ("close to the right of", YELLOW),
        (BETWEEN, GREEN + BLUE),
        ("close to the left of", YELLOW),
        ("far to the left of", BLUE),
        ("close to the right of", GREEN),
        (BETWEEN, YELLOW + GREEN),
        ("close to the right of", BLUE),
        ("far to the left of", YELLOW),
    )
    ASKED: ClassVar[tuple[Relation, ...]] = (
        ("far to the right of", BLUE),
        ("far to the right of", GREEN),
        (BETWEEN, BLUE + YELLOW),
        ("far to the right of", YELLOW),
    )

    def build(self, random: np.random.Generator) -> None:
        self._points = self._scene(random)
        self.add_cubes(random, self._points)

    def _scene(self, random: np.random.Generator) -> dict[str, Array]:
        """Where the blocks lie, with room for what is asked for."""
        for _ in range(MAX_SCENES):
            points = scatter(random, len(self.object_names), (0.04, -0.30), (0.36, 0.30), min_distance_m=0.11)
            named = dict(zip(self.object_names, points, strict=True))
            goal = self._goal(named)
            within = (goal >= REACHED_LOW_M).all() and (goal <= REACHED_HIGH_M).all()
            if within and min(np.linalg.norm(goal - point) for point in points) >= ROOM_M:
                return named
        raise ValueError(f"no scene has room {self.combination}")

    def _goal(self, points: dict[str, Array]) -> Array:
        relation, others = self.combination
        goal: Array = np.mean([points[other] for other in others], axis=0)
        goal[1] += OFFSETS_M.get(relation, 0.0)
        return goal

    @property
    def instruction(self) -> str:
        relation, others = self.combination
        return f"put the {BLOCK} {relation} " + " and ".join(f"the {other}" for other in others)

    def expert(self) -> list[Move]:
        drop_m = np.array([*self._goal(self._points), TABLE_TOP_M + BLOCK_HALF_M]) + BESIDE_DROP_M * UP
        return pick(*self.grasp(BLOCK)) + place(drop_m, tool_down(), straight=True)

    def succeeded(self) -> bool:
        there = {name: float(np.linalg.norm(self.position_m(name)[:2] - at)) for name, at in self._wanted().items()}
        stayed = all(there[other] < MAX_PUSH_M for other in OTHERS)
        return there[BLOCK] < MAX_OFFSET_M and stayed and self.on_table(BLOCK) and self.gripper_holds_nothing()

    def _wanted(self) -> dict[str, Array]:
        return {**self._points, BLOCK: self._goal(self._points)}


CUBES = ("red cube", "green cube", "blue cube")
PADS = ("white pad", "black pad", "pink pad", "cyan pad")
PAIRS: tuple[tuple[str, str], ...] = tuple(combinations(CUBES, 2))
# The pair to be swapped, and the pad that is free; all pairs come with each pad
Swap = tuple[tuple[str, str], str]
PAD_DROP_M = 0.003
MAX_PAD_OFFSET_M = 0.025
RAISED_M = 0.008  # a cube is set down where it is lower
BESIDE_M = 0.07  # from every pad, along x and y together
OVER_PAD_M = 0.10


class SwapCubes(BlockTask):
    """Four pads in x 0.05..0.36 m, y -0.28..0.28 m, at least 15 cm apart, and cubes on three of them.

    Poses are centers. Demonstrated are scenes whose white, black or pink pad is free, asked for are those whose cyan
    pad is. Success: the two cubes stand where the other was, the third has stayed, none has been set down beside the
    pads in between, and the gripper holds nothing. `events` are the cubes that were set down beside the pads.
    """

    name = "swap_cubes"
    object_names = (*CUBES, *PADS)
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    SHOWN: ClassVar[tuple[Swap, ...]] = tuple((pair, pad) for pad, pair in product(PADS[:3], PAIRS))
    ASKED: ClassVar[tuple[Swap, ...]] = tuple((pair, PADS[3]) for pair in PAIRS)

    def build(self, random: np.random.Generator) -> None:
        points = scatter(random, len(PADS), (0.05, -0.28), (0.36, 0.28), min_distance_m=0.15)
        places = dict(zip(PADS, points, strict=True))
        for pad, point in places.items():
            self.add_pad(random, pad, point)
        _, free_pad = self.combination
        taken = random.permutation([pad for pad in PADS if pad != free_pad]).tolist()
        self.add_cubes(random, {cube: places[pad] for cube, pad in zip(CUBES, taken, strict=True)})

    def after_reset(self) -> None:
        (first, second), _ = self.combination
        stays = next(cube for cube in CUBES if cube not in (first, second))
        found = {cube: self.data.body(cube).xpos.copy() for cube in CUBES}
        self._cubes = {cube: self.model.body(cube).id for cube in CUBES}
        self._pads_m = np.array([self.position_m(pad)[:2] for pad in PADS])
        self._goals_m = {first: found[second], second: found[first], stays: found[stays]}

    def latch(self) -> None:
        for cube, body in self._cubes.items():
            at_m = self.data.xpos[body]
            is_down = at_m[2] < TABLE_TOP_M + BLOCK_HALF_M + RAISED_M
            if is_down and cube not in self.events and np.abs(self._pads_m - at_m[:2]).sum(axis=1).min() > BESIDE_M:
                self.events.append(cube)

    @property
    def instruction(self) -> str:
        (first, second), _ = self.combination
        return f"swap the {first} and the {second} by way of the free pad"

    def expert(self) -> list[Move]:
        (first, second), free_pad = self.combination
        aside = self.position_m(free_pad) + (BLOCK_HALF_M - PAD_HALF_HEIGHT_M) * UP
        (of_first, first_turn), (of_second, second_turn) = self.grasp(first), self.grasp(second)
        carried = [(of_first, first_turn, aside), (of_second, second_turn, of_first), (aside, first_turn, of_second)]
        trips = [(start, turn, end + PAD_DROP_M * UP, turn) for start, turn, end in carried]
        return carry(trips, OVER_PAD_M, straight=True)

    def succeeded(self) -> bool:
        offsets = [self.position_m(cube) - goal_m for cube, goal_m in self._goals_m.items()]
        there = all(np.hypot(x, y) < MAX_PAD_OFFSET_M for x, y, _ in offsets)
        return there and not self.events and all(map(self.on_table, CUBES)) and self.gripper_holds_nothing()
