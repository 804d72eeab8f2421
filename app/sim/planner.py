"""Inverse kinematics, and paths of the joints for a sequence of moves, planned as a whole before the arm moves.

Inverse kinematics takes mink's QP steps from several seeds. A straight line can only be followed if the arm begins it
in a suitable posture. So a free move tries the postures that reach its pose until one also allows the straight lines
after it; a line that no posture allows becomes a free move.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mink
import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, Slerp

from app.sim import panda
from app.sim.moves import Move, ToolPose
from roboprompt_client.errors import MotionError
from roboprompt_client.types.arrays import Array

POSITION_TOLERANCE_M = 1e-3
ROTATION_TOLERANCE_RAD = np.radians(0.5)
# The iteration stops well inside the tolerances, so that a chain of solutions does not drift along their edge.
CONVERGED_M, CONVERGED_RAD = 2e-4, 2e-3
# Rotations count half of positions (rad against m); the posture cost only chooses among equal solutions.
ROTATION_COST, POSTURE_COST, DAMPING = 0.5, 1e-3, 1e-6
STEP_S = 0.1  # mink integrates velocities: the length of its steps cancels out but for the limits' gain
SEED_MARGIN_RAD = 0.02
SAME_SOLUTION_RAD = 0.15
# Offsets from the ready pose, found by trial over the table: base turned, reached out, elbow aside, wrist turned
SEED_OFFSETS_RAD = (
    (0, 0, 0, 0, 0, 0, 0),
    (0.6, 0, 0, 0, 0, 0, 0),
    (-0.6, 0, 0, 0, 0, 0, 0),
    (0, 0.5, 0, 0.3, 0, 0.5, 0),
    (0, 0.9, 0, 0, 0, 1.2, 0),
    (0.4, 0.6, -0.4, 0, 0, 1.0, 0),
    (-0.4, 0.6, 0.4, 0, 0, 1.0, 0),
    (0, 0, 0, 0, 0, 0, 1.2),
    (0, 0, 0, 0, 0, 0, -1.2),
    (0, 0.4, 0, 0.8, 0, 0.6, 1.2),
    (0, 0.4, 0, 0.8, 0, 0.6, -1.2),
)
NUM_FURTHER_SEEDS = 24

# Of straight lines
LINE_STEP_M, LINE_STEP_RAD = 0.02, 0.08
LINE_ITERATIONS = 25
# Neighboring points of a line whose joints differ by more lie on different branches: the arm would swing between them.
MAX_LINE_STEP_RAD = 0.6
# Postures tried for one free move; later ones are far from the arm's own and rarely help.
MAX_POSTURES = 16


class Kinematics:
    """Forward and inverse kinematics of the arm at a base position. Deterministic; not for use by several threads.

    Args:
        base_position_m: (3,) in the world frame.
    """

    def __init__(self, base_position_m: npt.ArrayLike) -> None:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        panda.add_arm(spec, base_position_m)
        model = spec.compile()
        self._configuration = mink.Configuration(model)
        self._site_id = model.site(panda.TCP_SITE).id
        self._tool = mink.FrameTask(
            panda.TCP_SITE, "site", position_cost=1.0, orientation_cost=ROTATION_COST, lm_damping=1e-4
        )
        self._posture = mink.PostureTask(model, cost=POSTURE_COST)
        self._limits = [mink.ConfigurationLimit(model)]

    def forward(self, joints_rad: Array) -> ToolPose:
        """The tool's pose for joint positions (7,)."""
        self._configuration.update(joints_rad)
        data = self._configuration.data
        rotation = Rotation.from_matrix(data.site_xmat[self._site_id].reshape(3, 3))
        return ToolPose(data.site_xpos[self._site_id].copy(), rotation)

    def solve(
        self,
        pose: ToolPose,
        seed_rad: Array,
        max_iterations: int = 40,
        preferred_rad: Array = panda.READY_RAD,
    ) -> Array | None:
        """Joint positions (7,) that reach `pose` within 1 mm and 0.5 degrees, iterating from a seed (7,); else None.

        Args:
            preferred_rad: (7,) of all that reach the pose, those towards these are chosen.
        """
        configuration = self._configuration
        configuration.update(seed_rad)
        self._posture.set_target(preferred_rad)
        rotation = mink.SO3.from_matrix(pose.rotation.as_matrix())
        self._tool.set_target(mink.SE3.from_rotation_and_translation(rotation, pose.position_m))
        for _ in range(max_iterations):
            if self._error_within(CONVERGED_M, CONVERGED_RAD):
                break
            velocity = mink.solve_ik(
                configuration, [self._tool, self._posture], STEP_S, "daqp", damping=DAMPING, limits=self._limits
            )
            configuration.integrate_inplace(velocity, STEP_S)
        if not self._error_within(POSITION_TOLERANCE_M, ROTATION_TOLERANCE_RAD):
            return None
        joints: Array = configuration.q.copy()
        return joints

    def _error_within(self, position_m: float, rotation_rad: float) -> bool:
        error = self._tool.compute_error(self._configuration)
        return bool(error[:3] @ error[:3] < position_m**2 and error[3:] @ error[3:] < rotation_rad**2)

    def solutions(self, pose: ToolPose, near_rad: Array) -> Iterator[Array]:
        """Distinct joint positions (7,) that reach `pose`, the most comfortable first.

        Those found from the common seeds come first; the further seeds are only tried if the caller asks for more.
        """
        found: list[Array] = []
        common = [near_rad, *(panda.READY_RAD + np.array(offset) for offset in SEED_OFFSETS_RAD)]
        random = np.random.default_rng(0)
        shape = (NUM_FURTHER_SEEDS, panda.NUM_JOINTS)
        for seeds in (common, list(random.uniform(panda.JOINT_MIN_RAD, panda.JOINT_MAX_RAD, shape))):
            new = self._new_solutions(pose, seeds, found)
            found += new
            yield from sorted(new, key=lambda joints: discomfort(joints, near_rad))

    def _new_solutions(self, pose: ToolPose, seeds_rad: list[Array], known: list[Array]) -> list[Array]:
        new: list[Array] = []
        for seed in seeds_rad:
            low, high = panda.JOINT_MIN_RAD + SEED_MARGIN_RAD, panda.JOINT_MAX_RAD - SEED_MARGIN_RAD
            joints = self.solve(pose, np.clip(seed, low, high))
            if joints is not None and all(np.abs(joints - k).max() > SAME_SOLUTION_RAD for k in (*known, *new)):
                new.append(joints)
        return new


def discomfort(joints_rad: Array, near_rad: Array) -> float:
    """Return the cost of joint positions (7,): distance from `near_rad`, nearness to limits, an elbow turned out."""
    middle = (panda.JOINT_MIN_RAD + panda.JOINT_MAX_RAD) / 2
    half_range = (panda.JOINT_MAX_RAD - panda.JOINT_MIN_RAD) / 2
    beyond = np.clip(np.abs((joints_rad - middle) / half_range) - 0.88, 0, None).sum() / 0.12
    turned_out = np.abs(joints_rad[[0, 2, 4]]).sum()
    return float(0.25 * np.linalg.norm(joints_rad - near_rad) + 8 * beyond + 0.1 * turned_out)


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
