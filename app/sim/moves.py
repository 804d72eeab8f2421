"""Moves of an arm: an end-effector pose, the way to it, and the state of the gripper there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

LOOSE_M = 0.03  # as close as it takes to a pose that only leads to another
UP = np.array([0.0, 0.0, 1.0])
# Where something is (3,) and how it is grasped; and where it is let go and how
Trip = tuple[Array, Rotation, Array, Rotation]


@dataclass(frozen=True, eq=False)
class ToolPose:
    """A pose of the point between the fingertips in the world frame.

    Attributes:
        position_m: (3,).
        rotation: takes tool axes to world axes; tool z is the direction of approach, the fingers move along tool y.
    """

    position_m: Array
    rotation: Rotation

    def apart(self, other: "ToolPose") -> tuple[float, float]:
        """How far another pose is from this one, m and rad."""
        apart_m = float(np.linalg.norm(other.position_m - self.position_m))
        return apart_m, float((self.rotation.inv() * other.rotation).magnitude())


@dataclass(frozen=True, eq=False)
class Move:
    """Go to a pose, then set the gripper.

    Attributes:
        straight: along a straight line; otherwise the arm takes the quickest way, as for a first approach.
        within_m: how closely a motion without rests passes the pose; 0: it must be at the pose. None: at the pose where
            the gripper opens or closes there, otherwise as closely as the person likes (`app.sim.guided`).
    """

    pose: ToolPose
    gripper_open: bool
    straight: bool = True
    within_m: float | None = None


def tool_down(yaw_rad: float = 0.0, tilt_rad: float = 0.0) -> Rotation:
    """The tool pointing down, its fingers moving along the horizontal direction `yaw_rad` + 90 degrees.

    A positive tilt leans the direction of approach from straight down towards the heading `yaw_rad`.
    """
    return Rotation.from_euler("z", yaw_rad) * Rotation.from_euler("y", -tilt_rad) * Rotation.from_euler("x", np.pi)


def nearest_yaw_rad(yaw_rad: float, symmetry_rad: float = np.pi) -> float:
    """The equivalent of a yaw that is nearest to 0 under a symmetry (a parallel gripper: pi, on a cube: pi/2)."""
    return (yaw_rad + symmetry_rad / 2) % symmetry_rad - symmetry_rad / 2


def move_to(
    position_m: npt.ArrayLike,
    rotation: Rotation,
    *,
    gripper_open: bool,
    straight: bool = True,
    within_m: float | None = None,
) -> Move:
    """A move from a position (3,) and a rotation."""
    return Move(ToolPose(np.asarray(position_m, dtype=np.float64), rotation), gripper_open, straight, within_m)


def pick(
    position_m: npt.ArrayLike, rotation: Rotation, clearance_m: float = 0.10, *, straight: bool = False
) -> list[Move]:
    """Approach along the tool's axis, close the gripper at the position, lift.

    Args:
        straight: come to the approach in a straight line too, where the quickest way may run into something.
    """
    at = np.asarray(position_m, dtype=np.float64)
    return [
        move_to(at - clearance_m * rotation.apply(UP), rotation, gripper_open=True, straight=straight),
        move_to(at, rotation, gripper_open=False),
        move_to(at + clearance_m * UP, rotation, gripper_open=False),
    ]


def place(
    position_m: npt.ArrayLike, rotation: Rotation, clearance_m: float = 0.10, *, straight: bool = False
) -> list[Move]:
    """Approach from above, open the gripper at the position, rise; `straight` as for `pick`."""
    at = np.asarray(position_m, dtype=np.float64)
    return [
        move_to(at + clearance_m * UP, rotation, gripper_open=False, straight=straight),
        move_to(at, rotation, gripper_open=True),
        move_to(at + clearance_m * UP, rotation, gripper_open=True),
    ]


def carry(
    trips: Sequence[Trip], over_m: float = 0.10, set_down_m: float | None = None, *, straight: bool = False
) -> list[Move]:
    """Pick things up and place them, one after the other.

    Args:
        over_m, set_down_m: the clearance where they are picked up, and where they are placed if it is another.
        straight: in straight lines all the way after the first approach.
    """
    moves: list[Move] = []
    for start_m, grasp, end_m, release in trips:
        moves += pick(start_m, grasp, over_m, straight=straight and bool(moves))
        moves += place(end_m, release, over_m if set_down_m is None else set_down_m, straight=straight)
    return moves


def push(route: Sequence[tuple[npt.ArrayLike, float | None]], rotation: Rotation) -> list[Move]:
    """Closed fingers along positions (3,), freely to the first, in straight lines from then on.

    Args:
        route: each position with the `within_m` of its move.
    """
    return [
        move_to(position_m, rotation, gripper_open=False, straight=index > 0, within_m=within_m)
        for index, (position_m, within_m) in enumerate(route)
    ]


def moves_from_actions(actions: Sequence[EndEffectorAction]) -> list[Move]:
    """Predicted actions as moves: freely to the first pose, in straight lines from then on."""
    return [
        move_to(
            action.position_m,
            Rotation.from_quat(action.quaternion_xyzw),
            gripper_open=action.gripper_open,
            straight=index > 0,
        )
        for index, action in enumerate(actions)
    ]


def action_from_move(move: Move) -> EndEffectorAction:
    """The move's pose and what the gripper then does."""
    return EndEffectorAction(move.pose.position_m, move.pose.rotation.as_quat(), move.gripper_open)
