"""A laptop on the table, hinge towards the robot: `close_laptop`, and `unplug_cable` with a cable in its side."""

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.sim.moves import LOOSE_M, UP, Move, move_to, push
from app.sim.scene import NO_TURN, SceneBody, about_z
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

HALF_DEPTH_M, HALF_WIDTH_M, HALF_THICKNESS_M = 0.11, 0.15, 0.011
FEET_M = 0.003
CENTER_HEIGHT_M = FEET_M + HALF_THICKNESS_M  # above the table
HINGE_M = (-HALF_DEPTH_M, 0.0, HALF_THICKNESS_M)  # in the laptop's frame
LID_LENGTH_M, LID_THICKNESS_M = 0.20, 0.008
MARK_M = 0.0005


class LaptopTask(SimTask):
    """A laptop whose front edge points away from the robot. Its pose is the center of its base, x to the front edge."""

    def add_laptop(self, center_m: npt.ArrayLike, turn: Rotation) -> SceneBody:
        """The body `laptop` with keyboard and touchpad; for use in `build`."""
        laptop = self.add_part("laptop", center_m, turn)
        laptop.box((HALF_DEPTH_M, HALF_WIDTH_M, HALF_THICKNESS_M), "grey")
        for x_m in (-0.08, 0.08):
            laptop.box((0.01, 0.13, FEET_M / 2), "black", at_m=[x_m, 0, -HALF_THICKNESS_M - FEET_M / 2])
        for x_m, half_m in ((-0.03, (0.05, 0.13)), (0.07, (0.03, 0.04))):
            laptop.mark((*half_m, MARK_M), "black", at_m=[x_m, 0, HALF_THICKNESS_M])
        return laptop

    def add_lid(self, laptop: SceneBody, opened: Rotation = NO_TURN) -> SceneBody:
        """The body `lid` about the hinge, along x where it is closed; the screen is on its lower side."""
        lid = self.add_part("lid", HINGE_M, opened, parent=laptop)
        half_sizes_m = (LID_LENGTH_M / 2, HALF_WIDTH_M, LID_THICKNESS_M / 2)
        lid.box(half_sizes_m, "black", at_m=[LID_LENGTH_M / 2, 0, LID_THICKNESS_M / 2], mass_kg=0.3)
        return lid.mark((LID_LENGTH_M / 2 - 0.012, HALF_WIDTH_M - 0.012, MARK_M), "cyan", at_m=[LID_LENGTH_M / 2, 0, 0])


CLOSE_MAX_TURN_RAD = np.pi / 3
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
OVER_LAPTOP_M = 0.09


class CloseLaptop(LaptopTask):
    """A laptop, its hinge towards the robot, its screen open by 90 to 110 degrees.

    Its center lies in x 0.22..0.38 m, y -0.20..0.20 m and it is turned by up to 60 degrees either way: the arm must
    reach between itself and the lid. The laptop's pose is the center of its base; x points from the hinge to the front
    edge. Success: the screen is closed (to 2 degrees).
    """

    name = "close_laptop"
    object_names = ("laptop",)
    instruction = "close the laptop"

    def build(self, random: np.random.Generator) -> None:
        point = random.uniform((0.22, -0.20), (0.38, 0.20))
        turn = about_z(random.uniform(-CLOSE_MAX_TURN_RAD, CLOSE_MAX_TURN_RAD))
        self._opened_rad = random.uniform(MIN_OPEN_RAD, MAX_OPEN_RAD)
        laptop = self.add_laptop([*point, TABLE_TOP_M + CENTER_HEIGHT_M], turn)
        lid = self.add_lid(laptop)
        lid.hinge("lid", (0, -1, 0), (0, MAX_HINGE_RAD), dry_friction_nm=HINGE_FRICTION_NM)

    def after_reset(self) -> None:
        self.data.joint("lid").qpos = self._opened_rad

    def expert(self) -> list[Move]:
        behind = np.array([BEHIND_M, 0, PUSH_HEIGHT_M])
        above = np.array([0, 0, OVER_LAPTOP_M])
        closed = _on_lid(0.0) - [0, 0, PRESS_M]
        pushing = [(_on_lid(np.radians(open_deg)), LOOSE_M / 3) for open_deg in (60.0, 25.0)]
        route = [(behind + above, LOOSE_M), (behind, LOOSE_M / 2), *pushing, (closed, 0.0), (closed + above, 0.0)]
        in_world = [(self.body_to_world("laptop", HINGE_M + point_m), within_m) for point_m, within_m in route]
        return push(in_world, self.tool_over("laptop"))

    def succeeded(self) -> bool:
        return bool(self.joint_position("lid") < CLOSED_RAD)


def _on_lid(open_rad: float) -> Array:
    """The tool's point (3,) relative to the hinge where the fingers touch the back of the lid."""
    cos, sin = np.cos(open_rad), np.sin(open_rad)
    x_m, z_m = PUSHED_AT_M * cos - LID_THICKNESS_M * sin, PUSHED_AT_M * sin + LID_THICKNESS_M * cos
    return np.array([x_m - FRONT_EDGE_M[0], 0.0, z_m - FRONT_EDGE_M[1]])


UNPLUG_MAX_TURN_RAD = np.pi / 4
OPEN_RAD = np.radians(105.0)
PLUG_HALF_M = (0.028, 0.010, 0.009)
PLUG_KG = 0.02
SOCKET_M = np.array([0.02, HALF_WIDTH_M + PLUG_HALF_M[0] + 0.001, 0.0])  # the plug's center in the laptop's frame
HOLD_N = 18.0  # the socket lets go of the plug when pulled harder
UNPLUGGED = "unplugged"
WELD_ROWS = 6  # three of force, three of torque
APART_M = 0.03
# The cable beyond the plug: a chain of stiff links that slopes to the table and then curves along it
LINK_M, LINK_RADIUS_M, LINK_KG = 0.03, 0.004, 0.004
LINKS, SLOPE_LINKS = 8, 2
SLOPE_RAD = np.arcsin((CENTER_HEIGHT_M - LINK_RADIUS_M) / (SLOPE_LINKS * LINK_M))
CURVE_RAD = np.radians(9.0)  # from link to link
LINK_DAMPING, LINK_SPRING_NM_RAD = 0.005, 0.05
GRASP_M = np.array([0.010, 0.0, 0.004])  # in the plug's frame: clear of the laptop's side
CLEARANCE_M, PULL_M = 0.10, 0.09


class UnplugCable(LaptopTask):
    """An open laptop with a cable in its left side, as seen from the robot.

    The laptop's center lies in x 0.08..0.27 m, y -0.22..0.06 m and it is turned by up to 45 degrees either way: the arm
    must still reach the place where it lets go of the plug. The laptop's pose is the center of its base, x from the
    hinge to the front edge; the cable's pose is the center of its plug, x out of the socket. The socket holds the plug
    until it is pulled by 18 N. Success: the socket has let go and the plug is 3 cm away from it.
    """

    name = "unplug_cable"
    object_names = ("laptop", "cable")
    instruction = "unplug the laptop"

    def build(self, random: np.random.Generator) -> None:
        turn = about_z(random.uniform(-UNPLUG_MAX_TURN_RAD, UNPLUG_MAX_TURN_RAD))
        center = np.array([*random.uniform((0.08, -0.22), (0.27, 0.06)), TABLE_TOP_M + CENTER_HEIGHT_M])
        laptop = self.add_laptop(center, turn)
        self.add_lid(laptop, Rotation.from_euler("y", -OPEN_RAD))
        plug = self.add_part("cable", center + turn.apply(SOCKET_M), turn * about_z(np.pi / 2), free=True)
        plug.box(PLUG_HALF_M, "orange", mass_kg=PLUG_KG)
        self._add_links(plug)
        weld = mujoco.mjtEq.mjEQ_WELD
        socket = self._spec.add_equality(name="socket", type=weld, name1="laptop", name2="cable")
        socket.objtype = mujoco.mjtObj.mjOBJ_BODY
        socket.data[:10] = 0  # no anchor; the relative pose in which the bodies are built

    def _add_links(self, plug: SceneBody) -> None:
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

    def expert(self) -> list[Move]:
        grasp = self.body_to_world("cable", GRASP_M)
        out = grasp + self.rotation("cable").apply([PULL_M, 0, 0])
        tool = self.tool_over("cable")
        return [
            move_to(grasp + CLEARANCE_M * UP, tool, gripper_open=True, straight=False),
            move_to(grasp, tool, gripper_open=False),
            move_to(out, tool, gripper_open=True),
            move_to(out + CLEARANCE_M * UP, tool, gripper_open=True),
        ]

    def succeeded(self) -> bool:
        away_m = np.linalg.norm(self.position_m("cable") - self.body_to_world("laptop", SOCKET_M))
        return UNPLUGGED in self.events and bool(away_m > APART_M)
