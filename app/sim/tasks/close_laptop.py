"""Close a laptop's screen."""

import numpy as np

from app.sim.moves import LOOSE_M, Move, move_to, tool_down
from app.sim.scene import about_z
from app.sim.tasks.base import SimTask
from app.sim.tasks.laptop import CENTRE_HEIGHT_M, HINGE_M, LID_THICKNESS_M, add_laptop, add_lid
from app.sim.world import TABLE_TOP_M
from roboprompt_client.arrays import Array

LOW_M, HIGH_M = (0.22, -0.20), (0.38, 0.20)
MAX_TURN_RAD = np.pi / 3
MIN_OPEN_RAD, MAX_OPEN_RAD = np.radians(90.0), np.radians(110.0)
MAX_HINGE_RAD = np.radians(130.0)
# Holds the lid where it is left, but below about 25 degrees, where a real lid's magnets would pull it shut as well
HINGE_FRICTION_NM = 0.265
CLOSED_RAD = np.radians(2.0)
# Where the closed fingers touch the lid: their front edge, from the tool's point
FRONT_EDGE_M = (0.010, -0.008)
PUSHED_AT_M = 0.165  # from the hinge, along the lid
PRESS_M = 0.003
BEHIND_M = -0.125  # from the hinge: 2 cm behind the lid where it is widest open
PUSH_HEIGHT_M = 0.155  # above the hinge
CLEARANCE_M = 0.09


class CloseLaptop(SimTask):
    """A laptop, its hinge towards the robot, its screen open by 90 to 110 degrees.

    Its centre lies in x 0.22..0.38 m, y -0.20..0.20 m and it is turned by up to 60 degrees either way: the arm must
    reach between itself and the lid. The laptop's pose is the centre of its base; x points from the hinge to the front
    edge. Success: the screen is closed (to 2 degrees).
    """

    name = "close_laptop"
    object_names = ("laptop",)

    def build(self, random: np.random.Generator) -> None:
        point = random.uniform(LOW_M, HIGH_M)
        turn = about_z(random.uniform(-MAX_TURN_RAD, MAX_TURN_RAD))
        self._opened_rad = random.uniform(MIN_OPEN_RAD, MAX_OPEN_RAD)
        laptop = add_laptop(self, [*point, TABLE_TOP_M + CENTRE_HEIGHT_M], turn)
        lid = add_lid(self, laptop)
        lid.hinge("lid", (0, -1, 0), (0, MAX_HINGE_RAD), damping=0.02, dry_friction_nm=HINGE_FRICTION_NM)

    def after_reset(self) -> None:
        self.data.joint("lid").qpos = self._opened_rad

    @property
    def instruction(self) -> str:
        return "close the laptop"

    def expert(self) -> list[Move]:
        down = tool_down(self.yaw_rad("laptop"))
        behind = np.array([BEHIND_M, 0, PUSH_HEIGHT_M])
        above = np.array([0, 0, CLEARANCE_M])
        closed = _on_lid(0.0) - [0, 0, PRESS_M]
        pushing = [(_on_lid(np.radians(open_deg)), LOOSE_M / 3) for open_deg in (60.0, 25.0)]
        route = [(behind + above, LOOSE_M), (behind, LOOSE_M / 2), *pushing, (closed, 0.0), (closed + above, 0.0)]
        return [
            move_to(self._from_hinge(point), down, gripper_open=False, straight=index > 0, within_m=within_m)
            for index, (point, within_m) in enumerate(route)
        ]

    def _from_hinge(self, point_m: Array) -> Array:
        """A point (3,) relative to the hinge, along the laptop's axes, in the world frame."""
        at: Array = self.position_m("laptop") + self.rotation("laptop").apply(HINGE_M + point_m)
        return at

    def succeeded(self) -> bool:
        return bool(self.joint_position("lid") < CLOSED_RAD)


def _on_lid(open_rad: float) -> Array:
    """The tool's point (3,) relative to the hinge where the fingers touch the back of the lid."""
    cos, sin = np.cos(open_rad), np.sin(open_rad)
    x_m, z_m = PUSHED_AT_M * cos - LID_THICKNESS_M * sin, PUSHED_AT_M * sin + LID_THICKNESS_M * cos
    return np.array([x_m - FRONT_EDGE_M[0], 0.0, z_m - FRONT_EDGE_M[1]])
