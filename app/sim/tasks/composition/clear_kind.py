"""Put every block of one colour in the tray, however many there are on the table."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import about_z, scatter
from app.sim.tasks.composition.base import BLOCK_HALF_M, CompositionTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.arrays import Array

KINDS = {kind: tuple(f"{number} {kind} block" for number in ("first", "second", "third")) for kind in ("red", "blue")}
BLOCKS = KINDS["red"] + KINDS["blue"]
TRAY = "tray"
# The colour, and how many blocks of it are on the table; the others are in the tray already
SHOWN = (("red", 1), ("red", 2), ("blue", 1), ("blue", 3))
ASKED = (("red", 3), ("blue", 2))
RADIUS_M, WALL_M, FLOOR_HALF_M = 0.125, 0.02, 0.0005
SLOT_RADIUS_M = 0.07  # every block has its place in the tray, a sixth of a turn from the next
ABOVE_SLOT_M = 0.037  # where a block is released: the fingers are above the blocks beside it
LIFTED_M = 0.03
LOW_M, HIGH_M = (0.02, -0.34), (0.38, 0.34)
TRAY_LOW_M, TRAY_HIGH_M = (0.14, -0.18), (0.26, 0.18)
MIN_DISTANCE_M, FROM_TRAY_M = 0.095, 0.175
CLEARANCE_M = 0.12


class ClearKind(CompositionTask):
    """A round tray in x 0.14..0.26 m, y -0.18..0.18 m, three red and three blue blocks; poses are centres.

    Some blocks of each colour are on the table, in x 0.02..0.38 m, y -0.34..0.34 m, turned at random, the others in the
    tray. Demonstrated are one and two red ones, one and three blue ones on the table; asked for are three red ones, and
    two blue ones. Success: all blocks of the colour are in the tray, no other block has been lifted, and the gripper
    holds nothing. `events` are the other blocks that were lifted.
    """

    name = "clear_kind"
    object_names = (*BLOCKS, TRAY)
    yaw_symmetry_deg: ClassVar[Mapping[str, float]] = {**dict.fromkeys(BLOCKS, 90.0), TRAY: 0.0}
    variations, test_only_variations = len(SHOWN), len(ASKED)

    @property
    def asked(self) -> tuple[str, int]:
        """The colour, and how many of it are on the table."""
        return (*SHOWN, *ASKED)[self.variation]

    def build(self, random: np.random.Generator) -> None:
        tray = random.uniform(TRAY_LOW_M, TRAY_HIGH_M)
        part = self.add_part(TRAY, [*tray, TABLE_TOP_M])
        part.cylinder(RADIUS_M, FLOOR_HALF_M, "wood", at_m=[0, 0, FLOOR_HALF_M])
        part.wall("wood", bottom_m=0.0, top_m=WALL_M, bottom_radius_m=RADIUS_M)
        colour, number = self.asked
        numbers = {kind: number if kind == colour else int(random.integers(1, 3)) for kind in KINDS}
        self._on_table = {
            block: kind
            for kind, blocks in KINDS.items()
            for block in sorted(random.permutation(blocks)[: numbers[kind]])
        }
        points = scatter(random, len(self._on_table), LOW_M, HIGH_M, MIN_DISTANCE_M, clear_of=[(tray, FROM_TRAY_M)])
        places = dict(zip(self._on_table, points, strict=True))
        for kind, blocks in KINDS.items():
            for block in blocks:
                at = places.get(block, tray + _slot_m(block)[:2])
                self.add_block(block, kind, at, random.uniform(-np.pi, np.pi))

    @property
    def _to_clear(self) -> list[str]:
        """In the order of their names."""
        return [block for block in BLOCKS if self._on_table.get(block) == self.asked[0]]

    def after_reset(self) -> None:
        self._others = {block: self.model.body(block).id for block in BLOCKS if block not in self._to_clear}

    def latch(self) -> None:
        for block, body in self._others.items():
            if self.data.xpos[body, 2] > TABLE_TOP_M + BLOCK_HALF_M + LIFTED_M and block not in self.events:
                self.events.append(block)

    @property
    def instruction(self) -> str:
        return f"put every {self.asked[0]} block in the {TRAY}"

    def expert(self) -> list[Move]:
        moves: list[Move] = []
        for block in self._to_clear:
            turn = tool_down(nearest_yaw_rad(self.yaw_rad(block), np.pi / 2))
            slot = self.position_m(TRAY) + _slot_m(block) + (BLOCK_HALF_M + ABOVE_SLOT_M) * UP
            moves += pick(self.position_m(block), turn, CLEARANCE_M, straight=bool(moves))
            moves += place(slot, tool_down(), CLEARANCE_M - ABOVE_SLOT_M, straight=True)
        return moves

    def succeeded(self) -> bool:
        tray = self.position_m(TRAY)
        offsets = np.array([self.position_m(block) - tray for block in KINDS[self.asked[0]]])
        inside = (np.hypot(offsets[:, 0], offsets[:, 1]) < RADIUS_M) & (offsets[:, 2] < 2 * BLOCK_HALF_M)
        return bool(inside.all()) and not self.events and self.gripper_holds_nothing()


def _slot_m(block: str) -> Array:
    """(3,) from the tray's centre to the block's place in it."""
    slot: Array = about_z(np.pi / 3 * BLOCKS.index(block)).apply([SLOT_RADIUS_M, 0, 0])
    return slot
