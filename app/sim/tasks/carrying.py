"""A cube that is carried past two barriers, each open at one end: `way_round`."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from app.sim.moves import UP, Move, move_to, pick
from app.sim.scene import about_z
from app.sim.tasks.cubes import BLOCK_HALF_M, BlockTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

BARRIERS = ("first barrier", "second barrier")
CUBE, PLATE = "cube", "plate"
LEFT, RIGHT = 1, -1  # the open end, along y
# In the scene's own frame, along x from the cube; a barrier's middle lies to one side of the line, its opening to the
# other
BARRIERS_M, PLATE_M = (0.12, 0.235), 0.345
BARRIER_ASIDE_M, OPENING_M = 0.09, 0.10
BARRIER_HALF_M = (0.007, 0.13, 0.03)
OPENING_HALF_M = 0.055
BESIDE_M = 0.052  # before and behind a barrier where the way turns
CARRY_M = 0.02  # how high the cube is carried: below the barriers' tops, the hand above them
PLATE_RADIUS_M, PLATE_HALF_HEIGHT_M = 0.05, 0.001
DROP_M, MAX_OFFSET_M = 0.004, 0.035
CORNER_WITHIN_M = 0.008  # how closely a person passes the corners of the way
SHIFT_M, TURN_RAD = 0.025, 0.25  # of cube and plate along y; of the whole scene


class WayRound(BlockTask):
    """A cube at x -0.02..0.11 m, y -0.06..0.06 m, behind it two 26 cm long barriers in a row and a plate.

    The scene is turned as a whole by up to 14 degrees. Each barrier reaches over the line from cube to plate to one
    side, its other end is open. Demonstrated are barriers that are both open to the left, both to the right, and to the
    left and then to the right; asked for are those open to the right and then to the left. Poses are centers. Success:
    the cube has passed each barrier once, round its open end and below its top, lies on the plate, and the gripper
    holds nothing. `events` are the barriers passed, with "wrong" before one that was passed otherwise.
    """

    name = "way_round"
    object_names = (CUBE, *BARRIERS, PLATE)
    yaw_symmetry_deg: ClassVar[Mapping[str, float]] = {CUBE: 90.0, **dict.fromkeys(BARRIERS, 180.0), PLATE: 0.0}
    SHOWN, ASKED = ((LEFT, LEFT), (RIGHT, RIGHT), (LEFT, RIGHT)), ((RIGHT, LEFT),)

    @property
    def open_ends(self) -> tuple[int, int]:
        """Of the first and the second barrier."""
        first, second = self.combination
        return first, second

    def build(self, random: np.random.Generator) -> None:
        self._origin = np.array([*random.uniform((-0.02, -0.06), (0.11, 0.06)), TABLE_TOP_M])
        self._turn = about_z(random.uniform(-TURN_RAD, TURN_RAD))
        cube_y_m, plate_y_m = random.uniform(-SHIFT_M, SHIFT_M, 2)
        self.add_cube_over(self._at(0, cube_y_m)[:2], CUBE, random.uniform(-np.pi, np.pi), color="red")
        for barrier, x_m, end in zip(BARRIERS, BARRIERS_M, self.open_ends, strict=True):
            part = self.add_part(barrier, self._at(x_m, -end * BARRIER_ASIDE_M, BARRIER_HALF_M[2]), self._turn)
            part.box(BARRIER_HALF_M, "grey")
        plate = self.add_part(PLATE, self._at(PLATE_M, plate_y_m, PLATE_HALF_HEIGHT_M))
        plate.mark((PLATE_RADIUS_M, PLATE_RADIUS_M, PLATE_HALF_HEIGHT_M), "white")

    def _at(self, x_m: float, y_m: float, height_m: float = 0.0) -> Array:
        point: Array = self._origin + self._turn.apply([x_m, y_m, height_m])
        return point

    def after_reset(self) -> None:
        self._cube = self.model.body(CUBE).id
        self._to_scene = self._turn.inv().as_matrix()
        self._passed = [False] * len(BARRIERS)

    def latch(self) -> None:
        x_m, y_m, height_m = self._to_scene @ (self.data.xpos[self._cube] - self._origin)
        for number, (barrier, barrier_m, end) in enumerate(zip(BARRIERS, BARRIERS_M, self.open_ends, strict=True)):
            if (x_m > barrier_m) == self._passed[number]:
                continue
            self._passed[number] = not self._passed[number]
            round_it = abs(y_m - end * OPENING_M) < OPENING_HALF_M and height_m < 2 * BARRIER_HALF_M[2]
            self.events.append(barrier if round_it else f"wrong {barrier}")

    @property
    def instruction(self) -> str:
        return "carry the cube to the plate through the open side of each barrier"

    def expert(self) -> list[Move]:
        turn = self.tool_over(CUBE)
        height_m = BLOCK_HALF_M + CARRY_M
        corners = [
            self._at(x_m + side_m, end * OPENING_M, height_m)
            for x_m, end in zip(BARRIERS_M, self.open_ends, strict=True)
            for side_m in (-BESIDE_M, BESIDE_M)
        ]
        above, grasp, lift = pick(self.position_m(CUBE), turn)
        lift = move_to(grasp.pose.position_m + CARRY_M * UP, turn, gripper_open=False, within_m=0.0)
        put_m = self.position_m(PLATE) + (BLOCK_HALF_M - PLATE_HALF_HEIGHT_M + DROP_M) * UP
        return [
            *(above, grasp, lift),
            *(move_to(corner, turn, gripper_open=False, within_m=CORNER_WITHIN_M) for corner in corners),
            move_to(put_m, turn, gripper_open=True),
            move_to(put_m + 0.10 * UP, turn, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        x, y, _ = self.position_m(CUBE) - self.position_m(PLATE)
        on_plate = bool(np.hypot(x, y) < MAX_OFFSET_M) and self.on_table(CUBE)
        return self.events == list(BARRIERS) and on_plate and self.gripper_holds_nothing()
