"""From a sequence of moves to paths of the joints, planned as a whole before the arm moves.

A straight line can only be followed if the arm begins it in a suitable posture. So a free move tries the postures that
reach its pose until one also allows the straight lines after it; a line that no posture allows becomes a free move.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from app.sim import panda
from app.sim.kinematics import Kinematics
from app.sim.moves import Move, ToolPose
from roboprompt_client.errors import MotionError
from roboprompt_client.types.arrays import Array

LINE_STEP_M, LINE_STEP_RAD = 0.02, 0.08
LINE_ITERATIONS = 25
# Neighboring points of a line whose joints differ by more lie on different branches: the arm would swing between them.
MAX_LINE_STEP_RAD = 0.6
# Postures tried for one free move; later ones are far from the arm's own and rarely help.
MAX_POSTURES = 16


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joint positions to pass.

    Attributes:
        joints_rad: (N, 7), from where the arm is to where it goes; N = 2 for a free move.
        straight: whether the points lie on a straight line of the tool.
    """

    joints_rad: Array
    straight: bool

    @property
    def end_rad(self) -> Array:
        """Joint positions (7,) at the end."""
        end: Array = self.joints_rad[-1]
        return end


class Planner:
    """Plans for one arm."""

    def __init__(self, kinematics: Kinematics) -> None:
        self.kinematics = kinematics

    def plan(self, start_rad: Array, moves: Sequence[Move]) -> list[JointPath]:
        """One path for each move, from joint positions (7,).

        Raises:
            MotionError: naming the first move whose pose the arm cannot reach.
        """
        paths: list[JointPath] = []
        joints = start_rad
        while len(paths) < len(moves):
            rest = moves[len(paths) :]
            new = self._lines(joints, rest)
            if not new:
                new = self._free_move_and_lines(joints, rest)
            if not new:
                raise MotionError(_unreachable(rest[0].pose, len(paths), len(moves)))
            paths += new
            joints = paths[-1].end_rad
        return paths

    def _free_move_and_lines(self, start_rad: Array, moves: Sequence[Move]) -> list[JointPath]:
        """A free move to the first pose and as many of the straight lines after it as some posture allows."""
        wanted = 1 + _count_lines(moves[1:])
        best: list[JointPath] = []
        for tried, joints in enumerate(self.kinematics.solutions(moves[0].pose, start_rad)):
            if tried == MAX_POSTURES:
                break
            paths = [JointPath(np.stack([start_rad, joints]), straight=False), *self._lines(joints, moves[1:])]
            if len(paths) > len(best):
                best = paths
            if len(best) == wanted:
                break
        return best

    def _lines(self, start_rad: Array, moves: Sequence[Move]) -> list[JointPath]:
        """The straight lines at the beginning of `moves`, up to the first that cannot be followed."""
        paths: list[JointPath] = []
        joints = start_rad
        for move in moves[: _count_lines(moves)]:
            path = self._line(joints, move.pose)
            if path is None:
                break
            paths.append(path)
            joints = path.end_rad
        return paths

    def _line(self, start_rad: Array, end: ToolPose) -> JointPath | None:
        start = self.kinematics.forward(start_rad)
        apart_m, angle_rad = start.apart(end)
        steps = max(2, int(np.ceil(max(apart_m / LINE_STEP_M, angle_rad / LINE_STEP_RAD))))
        turn = Slerp([0, 1], Rotation.concatenate([start.rotation, end.rotation]))
        points = [start_rad]
        for fraction in np.linspace(0, 1, steps + 1)[1:]:
            between = ToolPose(start.position_m + fraction * (end.position_m - start.position_m), turn(fraction))
            joints = self._next_point(between, points[-1])
            if joints is None:
                return None
            points.append(joints)
        return JointPath(np.array(points), straight=True)

    def _next_point(self, pose: ToolPose, joints_rad: Array) -> Array | None:
        """The joint positions at the next point of a line, if there are any without a swing of the arm.

        Where the ready posture pulls the elbow round, the arm keeps the posture it is in.
        """
        for preferred in (panda.READY_RAD, joints_rad):
            joints = self.kinematics.solve(pose, joints_rad, LINE_ITERATIONS, preferred)
            if joints is not None and np.abs(joints - joints_rad).max() <= MAX_LINE_STEP_RAD:
                return joints
        return None


def _count_lines(moves: Sequence[Move]) -> int:
    return next((index for index, move in enumerate(moves) if not move.straight), len(moves))


def _unreachable(pose: ToolPose, index: int, total: int) -> str:
    position = ", ".join(f"{value:.3f}" for value in pose.position_m)
    euler = ", ".join(f"{value:.0f}" for value in pose.rotation.as_euler("xyz", degrees=True, suppress_warnings=True))
    return (
        f"action {index + 1} of {total} is out of the arm's reach: position [{position}] m, xyz Euler [{euler}] degrees"
    )
