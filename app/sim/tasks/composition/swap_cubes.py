"""Let two cubes change places, by way of the pad that is free."""

from itertools import combinations, product

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import about_z, scatter
from app.sim.tasks.composition.base import BLOCK_HALF_M, CompositionTask
from app.sim.world import TABLE_TOP_M

CUBES = ("red cube", "green cube", "blue cube")
PADS = ("white pad", "black pad", "pink pad", "cyan pad")
PAIRS: tuple[tuple[str, str], ...] = tuple(combinations(CUBES, 2))
# The pair to be swapped, and the pad that is free; all pairs come with each pad
Swap = tuple[tuple[str, str], str]
SHOWN: tuple[Swap, ...] = tuple((pair, pad) for pad, pair in product(PADS[:3], PAIRS))
ASKED: tuple[Swap, ...] = tuple((pair, PADS[3]) for pair in PAIRS)
PAD_HALF_M, PAD_HALF_HEIGHT_M = 0.05, 0.001
DROP_M = 0.003
LOW_M, HIGH_M = (0.05, -0.28), (0.36, 0.28)
MIN_DISTANCE_M = 0.15
MAX_OFFSET_M = 0.025
RAISED_M = 0.008  # a cube is set down where it is lower
BESIDE_M = 0.07  # from every pad, along x and y together
CLEARANCE_M = 0.10


class SwapCubes(CompositionTask):
    """Four pads in x 0.05..0.36 m, y -0.28..0.28 m, at least 15 cm apart, and cubes on three of them.

    Poses are centres. Demonstrated are scenes whose white, black or pink pad is free, asked for are those whose cyan
    pad is. Success: the two cubes stand where the other was, the third has stayed, none has been set down beside the
    pads in between, and the gripper holds nothing. `events` are the cubes that were set down beside the pads.
    """

    name = "swap_cubes"
    object_names = (*CUBES, *PADS)
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    variations, test_only_variations = len(SHOWN), len(ASKED)

    @property
    def pair(self) -> tuple[str, str]:
        """The cubes to be swapped, in the order of the instruction."""
        return (*SHOWN, *ASKED)[self.variation][0]

    @property
    def free_pad(self) -> str:
        """The pad that no cube stands on."""
        return (*SHOWN, *ASKED)[self.variation][1]

    def build(self, random: np.random.Generator) -> None:
        places = dict(zip(PADS, scatter(random, len(PADS), LOW_M, HIGH_M, MIN_DISTANCE_M), strict=True))
        for pad, point in places.items():
            at_m = [*point, TABLE_TOP_M + PAD_HALF_HEIGHT_M]
            part = self.add_part(pad, at_m, about_z(random.uniform(-np.pi, np.pi)))
            part.mark((PAD_HALF_M, PAD_HALF_M, PAD_HALF_HEIGHT_M), pad.split()[0])
        taken = random.permutation([pad for pad in PADS if pad != self.free_pad]).tolist()
        for cube, pad in zip(CUBES, taken, strict=True):
            self.add_block(cube, cube.split()[0], places[pad], random.uniform(-np.pi, np.pi))

    def after_reset(self) -> None:
        first, second = self.pair
        stays = next(cube for cube in CUBES if cube not in self.pair)
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
        first, second = self.pair
        return f"swap the {first} and the {second} by way of the free pad"

    def expert(self) -> list[Move]:
        first, second = self.pair
        aside = self.position_m(self.free_pad) + (BLOCK_HALF_M - PAD_HALF_HEIGHT_M) * UP
        of_first, of_second = self.position_m(first), self.position_m(second)
        first_turn, second_turn = (tool_down(nearest_yaw_rad(self.yaw_rad(cube), np.pi / 2)) for cube in self.pair)
        carried = [(of_first, first_turn, aside), (of_second, second_turn, of_first), (aside, first_turn, of_second)]
        moves: list[Move] = []
        for start, turn, end in carried:
            moves += pick(start, turn, CLEARANCE_M, straight=bool(moves))
            moves += place(end + DROP_M * UP, turn, CLEARANCE_M, straight=True)
        return moves

    def succeeded(self) -> bool:
        offsets = [self.position_m(cube) - goal_m for cube, goal_m in self._goals_m.items()]
        there = all(np.hypot(x, y) < MAX_OFFSET_M for x, y, _ in offsets)
        return there and not self.events and all(map(self.on_table, CUBES)) and self.gripper_holds_nothing()
