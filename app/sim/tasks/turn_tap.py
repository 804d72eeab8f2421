"""Turn the left handle of a tap."""

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.moves import UP, Move, move_to, nearest_yaw_rad, tool_down
from app.sim.scene import about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M

LOW_M, HIGH_M = (0.12, -0.15), (0.30, 0.15)
PIPE_HALF_M = (0.025, 0.115, 0.025)
SPOUT_RADIUS_M, SPOUT_HEIGHT_M, SPOUT_REACH_M = 0.013, 0.095, 0.10
HANDLES = {"left tap": (0.09, "red"), "right tap": (-0.09, "blue")}  # y along the pipe, colour
# A handle is a bar across a stem; its centre is the origin of the handle's body
BAR_HALF_M = (0.036, 0.009, 0.012)
BAR_HEIGHT_M = 0.11
STEM_RADIUS_M = 0.009
MAX_TURN_RAD = np.radians(150.0)
TURNED_RAD = np.pi / 2  # paper, appendix
TURN_STEP_RAD = np.radians(55.0)  # two of these; the grasp may be off by half a bin of 5 degrees at either end
CLEARANCE_M = 0.10


class TurnTap(SimTask):
    """A tap with two handles on the table, at x 0.12..0.30 m, y -0.15..0.15 m, turned by any angle as in RLBench.

    To someone who faces the spout the left handle is the red one. Its pose is the centre of its bar, x along the bar.
    Success: the left handle has been turned by 90 degrees.
    """

    name = "turn_tap"
    object_names = ("left tap",)
    yaw_symmetry_deg = dict.fromkeys(object_names, 180.0)

    def build(self, random: np.random.Generator) -> None:
        point = random.uniform(LOW_M, HIGH_M)
        tap = self.add_part("tap", [*point, TABLE_TOP_M], about_z(random.uniform(-np.pi, np.pi)))
        tap.box(PIPE_HALF_M, "grey", at_m=[0, 0, PIPE_HALF_M[2]])
        tap.cylinder(SPOUT_RADIUS_M, SPOUT_HEIGHT_M / 2, "grey", at_m=[0, 0, SPOUT_HEIGHT_M / 2])
        forward = Rotation.from_euler("y", np.pi / 2)
        spout_m = [-SPOUT_REACH_M / 2, 0, SPOUT_HEIGHT_M]
        tap.capsule(SPOUT_RADIUS_M, SPOUT_REACH_M / 2, "grey", at_m=spout_m, rotation=forward)
        tap.cylinder(SPOUT_RADIUS_M, 0.012, "grey", at_m=[-SPOUT_REACH_M, 0, SPOUT_HEIGHT_M - 0.012])
        for name, (y_m, colour) in HANDLES.items():
            handle = self.add_part(name, [0, y_m, BAR_HEIGHT_M], parent=tap).box(BAR_HALF_M, colour)
            stem_m = BAR_HEIGHT_M - 2 * PIPE_HALF_M[2] - BAR_HALF_M[2]
            handle.cylinder(STEM_RADIUS_M, stem_m / 2, "grey", at_m=[0, 0, -BAR_HALF_M[2] - stem_m / 2])
            handle.hinge(name, (0, 0, 1), (-0.05, MAX_TURN_RAD), damping=0.02, dry_friction_nm=0.05)

    @property
    def instruction(self) -> str:
        return "turn left tap"

    def expert(self) -> list[Move]:
        bar = self.position_m("left tap")
        yaw_rad = nearest_yaw_rad(self.yaw_rad("left tap"))
        before, between, after = (tool_down(yaw_rad + steps * TURN_STEP_RAD) for steps in range(3))
        return [
            move_to(bar + CLEARANCE_M * UP, before, gripper_open=True, straight=False),
            move_to(bar, before, gripper_open=False),
            move_to(bar, between, gripper_open=False),
            move_to(bar, after, gripper_open=True),
            move_to(bar + CLEARANCE_M * UP, after, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        return self.joint_position("left tap") >= TURNED_RAD
