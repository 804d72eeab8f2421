"""Things that are pushed over the table: `slide_block`, and with a broom `sweep_to_dustpan`."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.moves import LOOSE_M, UP, Move, move_to, pick, push, tool_down
from app.sim.scene import SceneBody, about_z, scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

BLOCK_HALF_M = 0.03
SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M = 0.045, 0.0005
DISTANCE_M = 0.16
SQUARES = {"green target": "green", "blue square": "blue", "pink square": "pink", "yellow square": "yellow"}
PUSH_HEIGHT_M = 0.022  # the fingers reach 8 mm lower
FINGER_HALF_M = 0.010  # of the closed fingers, in the direction of the push
BEHIND_M, RISE_M = 0.035, 0.10


class SlideBlock(SimTask):
    """A 6 cm block at x 0.12..0.30 m, y -0.15..0.15 m and four squares around it, each 16 cm away.

    As in RLBench block and squares are turned as a whole, by any angle. The block's pose is its center. The target's
    pose is its center; x points away from the block, towards the white stripe on its far edge. Success: some part of
    the block lies on the green square.
    """

    name = "slide_block"
    object_names = ("block", "green target")
    yaw_symmetry_deg: ClassVar[Mapping[str, float]] = {"block": 90.0}
    instruction = "slide the block to the green target"

    def build(self, random: np.random.Generator) -> None:
        center = np.array([*random.uniform((0.12, -0.15), (0.30, 0.15)), TABLE_TOP_M])
        yaw_rad = random.uniform(-np.pi, np.pi)
        self.add_cube("block", "red", center + BLOCK_HALF_M * UP, BLOCK_HALF_M, yaw_rad, mass_kg=0.15)
        for quarter, (name, color) in enumerate(SQUARES.items()):
            turn = about_z(yaw_rad + quarter * np.pi / 2)
            at_m = center + turn.apply([DISTANCE_M, 0, SQUARE_HALF_THICKNESS_M])
            square = self.add_part(name, at_m, turn)
            square.mark((SQUARE_HALF_M, SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M), color)
            stripe_m = [SQUARE_HALF_M - 0.006, 0, SQUARE_HALF_THICKNESS_M]
            square.mark((0.004, SQUARE_HALF_M, SQUARE_HALF_THICKNESS_M), "white", at_m=stripe_m)

    def expert(self) -> list[Move]:
        touching_m = BLOCK_HALF_M + FINGER_HALF_M  # from the block's center
        start_m, end_m = -DISTANCE_M - touching_m - BEHIND_M, -touching_m
        route = [(start_m, RISE_M, LOOSE_M), (start_m, 0, BEHIND_M / 4), (end_m, 0, 0), (end_m, RISE_M, 0)]
        in_world = [
            (self.body_to_world("green target", [x_m, 0, PUSH_HEIGHT_M + rise_m]), within_m)
            for x_m, rise_m, within_m in route
        ]
        return push(in_world, self.tool_over("green target"))

    def succeeded(self) -> bool:
        """The block's inscribed circle reaches into the square."""
        offset = self.world_to_body("green target", self.position_m("block"))
        outside_m = np.maximum(np.abs(offset[:2]) - SQUARE_HALF_M, 0)
        return bool(np.linalg.norm(outside_m) < BLOCK_HALF_M)


# The broom, around the point of its handle where it is grasped; it sweeps along x, its brush in front of the handle
GRASP_HEIGHT_M = 0.13
HANDLE_HALF_M, HANDLE_TOP_M = 0.012, 0.030
BRUSH_HALF_M, HEAD_HALF_M = (0.010, 0.062, 0.020), (0.010, 0.062, 0.008)
BRUSH_FORWARD_M = 0.008
BROOM_KG, BRUSH_KG = 0.08, 0.02
# The brush gives way, so that it still touches the table when the broom is held up to 1 cm too high
BRUSH_TRAVEL_M, BRUSH_N_M, BRUSH_REST_M = 0.025, 150.0, -0.006
PRESS_M = 0.010  # how much lower than it stood the broom sweeps
# The dustpan, from the middle of its front edge; x points inside
PAN_DEPTH_M, PAN_HALF_WIDTH_M, PAN_WALL_M, PAN_FLOOR_M = 0.14, 0.09, 0.020, 0.002
PAN_FRICTION, BRUSH_FRICTION = 0.3, 0.3
# The ramp begins below the table and ends above the pan's floor, so that the brush meets no step; its ends in x and z
RAMP_FROM_M, RAMP_TO_M = (-0.010, -0.001), (0.020, PAN_FLOOR_M + 0.0005)
# Where things stand, along x from the dustpan's front edge
DIRT_M, BEHIND_DIRT_M, BROOM_M, INSIDE_M = -0.06, -0.132, -0.215, 0.045
NUM_DIRT, DIRT_HALF_M, DIRT_KG, DIRT_FRICTION = 5, 0.006, 0.003, 0.35
DIRT_SPREAD_M, DIRT_DISTANCE_M = 0.030, 0.018  # to either side of the heap's middle; from crumb to crumb
BROOM_SHIFT_M, BROOM_TURN_RAD = 0.02, np.radians(15.0)
HOLDER_HALF_M, HOLDER_HEIGHT_M, HOLDER_WALL_M = (0.024, 0.076), 0.04, 0.003
LIFT_M = 0.08
BEHIND_WITHIN_M = 0.008  # the brush is down before it reaches the dirt
TOOL_TURN_RAD = np.pi / 2  # the fingers close along the broom's x


class SweepToDustpan(SimTask):
    """A dustpan, a heap of five dirt particles before it and behind that a broom in its holder, in a line.

    The heap's middle lies in x 0.19..0.29 m, y -0.08..0.08 m. The line is turned at random about it; the broom stands
    up to 2 cm beside it and up to 15 degrees askew. The broom's pose is the point of its handle to grasp it at; x is
    where its brush points. The dustpan's is the middle of its front edge; x points inside. Success: all five dirt
    particles are in the dustpan.
    """

    name = "sweep_to_dustpan"
    object_names = ("broom", "dustpan")
    instruction = "sweep the dirt to the dustpan"

    def build(self, random: np.random.Generator) -> None:
        turn = about_z(random.uniform(-np.pi, np.pi))
        dirt = np.array([*random.uniform((0.19, -0.08), (0.29, 0.08)), TABLE_TOP_M])
        pan = dirt - turn.apply([DIRT_M, 0, 0])
        _add_pan(self.add_part("dustpan", pan, turn))
        shift = [BROOM_M, random.uniform(-BROOM_SHIFT_M, BROOM_SHIFT_M), 0]
        broom_turn = turn * about_z(random.uniform(-BROOM_TURN_RAD, BROOM_TURN_RAD))
        self._add_broom(pan + turn.apply(shift), broom_turn)
        low_m, high_m = (-DIRT_SPREAD_M, -DIRT_SPREAD_M), (DIRT_SPREAD_M, DIRT_SPREAD_M)
        for number, point in enumerate(scatter(random, NUM_DIRT, low_m, high_m, DIRT_DISTANCE_M)):
            at_m = dirt + turn.apply([*point, DIRT_HALF_M])
            self.add_cube(f"dirt {number}", "black", at_m, DIRT_HALF_M, mass_kg=DIRT_KG, friction=DIRT_FRICTION)

    def _add_broom(self, foot_m: Array, turn: Rotation) -> None:
        _add_holder(self.add_part("broom holder", foot_m + turn.apply([BRUSH_FORWARD_M, 0, 0]), turn))
        broom = self.add_part("broom", foot_m + GRASP_HEIGHT_M * UP, turn, free=True)
        head_top_m = 2 * (BRUSH_HALF_M[2] + HEAD_HALF_M[2]) - GRASP_HEIGHT_M
        half_length = (HANDLE_TOP_M - head_top_m) / 2
        handle_half_m = (HANDLE_HALF_M, HANDLE_HALF_M, half_length)
        broom.box(handle_half_m, "wood", at_m=[0, 0, HANDLE_TOP_M - half_length], mass_kg=BROOM_KG / 2)
        broom.box(HEAD_HALF_M, "wood", at_m=[BRUSH_FORWARD_M, 0, head_top_m - HEAD_HALF_M[2]], mass_kg=BROOM_KG / 2)
        brush = self.add_part("brush", [BRUSH_FORWARD_M, 0, BRUSH_HALF_M[2] - GRASP_HEIGHT_M], parent=broom)
        brush.box(BRUSH_HALF_M, "yellow", mass_kg=BRUSH_KG, friction=BRUSH_FRICTION)
        brush.slide(
            "brush", (0, 0, 1), (0, BRUSH_TRAVEL_M), damping=4.0, spring_n_m=BRUSH_N_M, spring_rest_m=BRUSH_REST_M
        )

    def expert(self) -> list[Move]:
        grasp = tool_down(self.yaw_rad("broom") + TOOL_TURN_RAD)
        sweep = tool_down(self.yaw_rad("dustpan") + TOOL_TURN_RAD)
        height_m = GRASP_HEIGHT_M - PRESS_M
        behind, inside = (self.body_to_world("dustpan", [x_m, 0, height_m]) for x_m in (BEHIND_DIRT_M, INSIDE_M))
        return [
            *pick(self.position_m("broom"), grasp, LIFT_M),
            move_to(behind + LIFT_M * UP, sweep, gripper_open=False),
            move_to(behind, sweep, gripper_open=False, within_m=BEHIND_WITHIN_M),
            move_to(inside, sweep, gripper_open=False, within_m=0.0),
            move_to(inside + LIFT_M * UP, sweep, gripper_open=False),
        ]

    def succeeded(self) -> bool:
        dirt = self.world_to_body("dustpan", [self.position_m(f"dirt {number}") for number in range(NUM_DIRT)])
        inside = (dirt[:, 0] > 0) & (dirt[:, 0] < PAN_DEPTH_M) & (np.abs(dirt[:, 1]) < PAN_HALF_WIDTH_M)
        return bool((inside & (dirt[:, 2] < 2 * PAN_WALL_M)).all())


def _add_pan(pan: SceneBody) -> None:
    half_floor, half_wall = PAN_FLOOR_M / 2, PAN_WALL_M
    (from_x, from_z), (to_x, to_z) = RAMP_FROM_M, RAMP_TO_M
    slope = Rotation.from_euler("y", -np.arctan2(to_z - from_z, to_x - from_x))
    ramp_at_m = np.array([(from_x + to_x) / 2, 0, (from_z + to_z) / 2]) - slope.apply([0, 0, half_floor])
    half_length = (to_x - from_x) / 2
    pan.box((half_length, PAN_HALF_WIDTH_M, half_floor), "cyan", at_m=ramp_at_m, rotation=slope, friction=PAN_FRICTION)
    half_depth = (PAN_DEPTH_M - to_x) / 2
    floor_at_m = [to_x + half_depth, 0, half_floor]
    pan.box((half_depth, PAN_HALF_WIDTH_M, half_floor), "cyan", at_m=floor_at_m, friction=PAN_FRICTION)
    for y_m in (-PAN_HALF_WIDTH_M, PAN_HALF_WIDTH_M):
        pan.box((PAN_DEPTH_M / 2, 0.003, half_wall), "cyan", at_m=[PAN_DEPTH_M / 2, y_m, half_wall])
    pan.box((0.003, PAN_HALF_WIDTH_M, half_wall), "cyan", at_m=[PAN_DEPTH_M, 0, half_wall])


def _add_holder(holder: SceneBody) -> None:
    (half_x, half_y), half_height = HOLDER_HALF_M, HOLDER_HEIGHT_M / 2
    for x_m in (-half_x, half_x):
        holder.box((HOLDER_WALL_M, half_y, half_height), "grey", at_m=[x_m, 0, half_height])
    for y_m in (-half_y, half_y):
        holder.box((half_x, HOLDER_WALL_M, half_height), "grey", at_m=[0, y_m, half_height])
