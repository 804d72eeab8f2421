"""Pull the plug of a laptop's cable."""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.moves import UP, Move, move_to, tool_down
from app.sim.scene import Part, about_z
from app.sim.tasks.base import SimTask
from app.sim.tasks.laptop import CENTRE_HEIGHT_M, HALF_WIDTH_M, add_laptop, add_lid
from app.sim.world import TABLE_TOP_M

LOW_M, HIGH_M = (0.08, -0.22), (0.27, 0.06)
MAX_TURN_RAD = np.pi / 4
OPEN_RAD = np.radians(105.0)
PLUG_HALF_M = (0.028, 0.010, 0.009)
PLUG_KG = 0.02
SOCKET_M = np.array([0.02, HALF_WIDTH_M + PLUG_HALF_M[0] + 0.001, 0.0])  # the plug's centre in the laptop's frame
HOLD_N = 18.0  # the socket lets go of the plug when pulled harder
UNPLUGGED = "unplugged"
WELD_ROWS = 6  # three of force, three of torque
APART_M = 0.03
# The cable beyond the plug: a chain of stiff links that slopes to the table and then curves along it
LINK_M, LINK_RADIUS_M, LINK_KG = 0.03, 0.004, 0.004
LINKS, SLOPE_LINKS = 8, 2
SLOPE_RAD = np.arcsin((CENTRE_HEIGHT_M - LINK_RADIUS_M) / (SLOPE_LINKS * LINK_M))
CURVE_RAD = np.radians(9.0)  # from link to link
LINK_DAMPING, LINK_SPRING_NM_RAD = 0.005, 0.05
GRASP_M = np.array([0.010, 0.0, 0.004])  # in the plug's frame: clear of the laptop's side
CLEARANCE_M, PULL_M = 0.10, 0.09


class UnplugCable(SimTask):
    """An open laptop with a cable in its left side, as seen from the robot.

    The laptop's centre lies in x 0.08..0.27 m, y -0.22..0.06 m and it is turned by up to 45 degrees either way: the arm
    must still reach the place where it lets go of the plug. The laptop's pose is the centre of its base, x from the
    hinge to the front edge; the cable's pose is the centre of its plug, x out of the socket. The socket holds the plug
    until it is pulled by 18 N. Success: the socket has let go and the plug is 3 cm away from it.
    """

    name = "unplug_cable"
    object_names = ("laptop", "cable")

    def build(self, random: np.random.Generator) -> None:
        turn = about_z(random.uniform(-MAX_TURN_RAD, MAX_TURN_RAD))
        centre = np.array([*random.uniform(LOW_M, HIGH_M), TABLE_TOP_M + CENTRE_HEIGHT_M])
        laptop = add_laptop(self, centre, turn)
        add_lid(self, laptop, Rotation.from_euler("y", -OPEN_RAD))
        plug = self.add_part("cable", centre + turn.apply(SOCKET_M), turn * about_z(np.pi / 2), free=True)
        plug.box(PLUG_HALF_M, "orange", mass_kg=PLUG_KG)
        self._add_links(plug)
        weld = mujoco.mjtEq.mjEQ_WELD
        socket = self._spec.add_equality(name="socket", type=weld, name1="laptop", name2="cable")
        socket.objtype = mujoco.mjtObj.mjOBJ_BODY
        socket.data[:10] = 0  # no anchor; the relative pose in which the bodies are built

    def _add_links(self, plug: Part) -> None:
        bends = {0: Rotation.from_euler("y", SLOPE_RAD), SLOPE_LINKS: Rotation.from_euler("y", -SLOPE_RAD)}
        along_x = Rotation.from_euler("y", np.pi / 2)
        middle_m = [LINK_M / 2, 0, 0]
        link, at_m = plug, [PLUG_HALF_M[0], 0, 0]
        for index in range(LINKS):
            link = self.add_part(f"link {index}", at_m, bends.get(index, about_z(CURVE_RAD)), parent=link)
            link.capsule(LINK_RADIUS_M, LINK_M / 2, "black", at_m=middle_m, rotation=along_x, mass_kg=LINK_KG)
            link.ball(damping=LINK_DAMPING, spring_nm_rad=LINK_SPRING_NM_RAD)
            at_m = [LINK_M, 0, 0]

    def after_reset(self) -> None:
        self._socket_id = self.model.equality("socket").id
        self._plug_axes = self.data.body("cable").xmat.reshape(3, 3)  # a view

    def latch(self) -> None:
        if self.data.eq_active[self._socket_id] and self._pull_n() > HOLD_N:
            self.data.eq_active[self._socket_id] = 0
            self.events.append(UNPLUGGED)

    def _pull_n(self) -> float:
        """The force between plug and socket along the plug's axis."""
        end = self.data.ne  # equality constraints come first, the socket is the last of them
        force_n = self.data.efc_force[end - WELD_ROWS : end][:3]
        return abs(float(force_n @ self._plug_axes[:, 0]))

    @property
    def instruction(self) -> str:
        return "unplug the laptop"

    def expert(self) -> list[Move]:
        plug = self.rotation("cable")
        grasp = self.position_m("cable") + plug.apply(GRASP_M)
        out = grasp + plug.apply([PULL_M, 0, 0])
        tool = tool_down(self.yaw_rad("cable"))
        return [
            move_to(grasp + CLEARANCE_M * UP, tool, gripper_open=True, straight=False),
            move_to(grasp, tool, gripper_open=False),
            move_to(out, tool, gripper_open=True),
            move_to(out + CLEARANCE_M * UP, tool, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        socket = self.position_m("laptop") + self.rotation("laptop").apply(SOCKET_M)
        away_m = np.linalg.norm(self.position_m("cable") - socket)
        return UNPLUGGED in self.events and bool(away_m > APART_M)
