"""Slide a block onto the green square."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from app.sim.moves import LOOSE_M, UP, Move, move_to, tool_down
from app.sim.scene import about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

LOW_M, HIGH_M = (0.12, -0.15), (0.30, 0.15)
BLOCK_HALF_M, BLOCK_KG = 0.03, 0.15
SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M = 0.045, 0.0005
DISTANCE_M = 0.16
SQUARES = {"green target": "green", "blue square": "blue", "pink square": "pink", "yellow square": "yellow"}
PUSH_HEIGHT_M = 0.022  # the fingers reach 8 mm lower
FINGER_HALF_M = 0.010  # of the closed fingers, in the direction of the push
BEHIND_M = 0.035
CLEARANCE_M = 0.10


class SlideBlock(SimTask):
    """A 6 cm block at x 0.12..0.30 m, y -0.15..0.15 m and four squares around it, each 16 cm away.

    As in RLBench block and squares are turned as a whole, by any angle. The block's pose is its centre. The target's
    pose is its centre; x points away from the block, towards the white stripe on its far edge. Success: some part of
    the block lies on the green square.
    """

    name = "slide_block"
    object_names = ("block", "green target")
    yaw_symmetry_deg: ClassVar[Mapping[str, float]] = {"block": 90.0}

    def build(self, random: np.random.Generator) -> None:
        centre = np.array([*random.uniform(LOW_M, HIGH_M), TABLE_TOP_M])
        yaw_rad = random.uniform(-np.pi, np.pi)
        block = self.add_part("block", centre + BLOCK_HALF_M * UP, about_z(yaw_rad), free=True)
        block.box((BLOCK_HALF_M,) * 3, "red", mass_kg=BLOCK_KG)
        for quarter, (name, colour) in enumerate(SQUARES.items()):
            turn = about_z(yaw_rad + quarter * np.pi / 2)
            at_m = centre + turn.apply([DISTANCE_M, 0, SQUARE_HALF_THICKNESS_M])
            square = self.add_part(name, at_m, turn)
            square.mark((SQUARE_HALF_M, SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M), colour)
            stripe_m = [SQUARE_HALF_M - 0.006, 0, SQUARE_HALF_THICKNESS_M]
            square.mark((0.004, SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M), "white", at_m=stripe_m)

    @property
    def instruction(self) -> str:
        return "slide the block to the green target"

    def expert(self) -> list[Move]:
        target, turn = self.position_m("green target"), self.rotation("green target")
        tool = tool_down(self.yaw_rad("green target"))
        touching_m = BLOCK_HALF_M + FINGER_HALF_M  # from the block's centre
        start_m, end_m = -DISTANCE_M - touching_m - BEHIND_M, -touching_m
        route = [(start_m, CLEARANCE_M, LOOSE_M), (start_m, 0, BEHIND_M / 4), (end_m, 0, 0), (end_m, CLEARANCE_M, 0)]
        return [
            move_to(
                target + turn.apply([x_m, 0, PUSH_HEIGHT_M + rise_m]),
                tool,
                gripper_open=False,
                straight=index > 0,
                within_m=within_m,
            )
            for index, (x_m, rise_m, within_m) in enumerate(route)
        ]

    def succeeded(self) -> bool:
        """The block's inscribed circle reaches into the square."""
        offset = self.rotation("green target").inv().apply(self.position_m("block") - self.position_m("green target"))
        outside_m = np.maximum(np.abs(offset[:2]) - SQUARE_HALF_M, 0)
        return bool(np.linalg.norm(outside_m) < BLOCK_HALF_M)
