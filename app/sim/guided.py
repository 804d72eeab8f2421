"""The simulated arm as if a person guided it by hand: without rests, and with pace, overshoots and hesitations.

It passes the poses of a plan and stops only where the gripper acts. The person's habits are drawn from the scene's
seed, so that a scene has one recording.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from app.sim import panda
from app.sim.motion import JointMotion, Pace, Route, joined
from app.sim.moves import Move, ToolPose
from app.sim.planner import JointPath
from app.sim.robot import GRIPPER_S, VELOCITY_LEAD_S, SimulatedPanda
from app.sim.tasks.base import SimTask
from app.sim.world import TIMESTEP_S
from roboprompt_client.errors import MotionError
from roboprompt_client.types.arrays import Array

STREAM = 3  # keeps the draw of habits apart from that of the same seed's scene

# How far corners may be passed where it does not matter: right angles are passed at 0.7 times as much, 1 to 3 cm
ROUNDING_M = (0.015, 0.04)
TOOL_SPEED_M_S = 0.32
PACE = (0.7, 1.1)  # of a whole demonstration
PHASE_M, PHASE_PACE = (0.06, 0.18), (0.5, 1.3)  # quick and slow phases
APPROACH_M, APPROACH_SPEED_M_S = 0.04, 0.10  # the last bit before a pose that must be reached
MAX_HESITATIONS = 2
HESITATION_M, HESITATION_SPEED_M_S = (0.003, 0.006), 0.012
CLEAR_M = 0.05  # a hesitation is at least as far from where something happens
OVERSHOOT_SHARE, OVERSHOOT_M = 0.7, (0.006, 0.02)
OVERSHOOT_WITHIN_M = 0.003
GRASP_LEAD_S = (0.05, 0.3)  # the command to close comes while the hand is still moving
RELEASE_LEAD_S = 0.0
ON_THE_WAY = (0.1, 0.5)  # where on a leg a gripper is set that touches nothing
FINGER_SPEED_M_S = 0.1  # the Franka Hand's (data sheet)
FINGERS_AT_REST_M_S = 0.002
# Fingers that are commanded this much further grip with their full force
GRIP_M = panda.GRIP_FORCE_N / panda.GRIP_STIFFNESS
WATCH_S = 0.02  # how often the person looks whether the fingers have done it

_Event = tuple[int, Callable[[], None]]


@dataclass(frozen=True, eq=False)
class GuidedMove:
    """A move as the person makes it.

    Attributes:
        number: the move's in the expert's plan; None for an overshoot, which the plan does not have.
        within_m: how far the move's pose may be passed; 0: it is reached.
    """

    move: Move
    number: int | None
    within_m: float


class Habits:
    """How a person guides the arm in the scene of a seed. The same calls in the same order give the same values."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng((STREAM, seed))
        self._pace = self._random.uniform(*PACE)

    def choose(self, number: int) -> int:
        """One of several ways to do a task, 0..number - 1."""
        return int(self._random.integers(number))

    def steps(self, start: ToolPose, gripper_open: bool, moves: Sequence[Move]) -> list[GuidedMove]:
        """The moves with how closely each is passed, and overshoots before grasps.

        Args:
            start, gripper_open: of the arm before the first move.
        """
        steps: list[GuidedMove] = []
        for number, move in enumerate(moves):
            last = number == len(moves) - 1
            changes = move.gripper_open != gripper_open
            rounding_m = self._random.uniform(*ROUNDING_M)
            grasps = not last and move.gripper_open and not moves[number + 1].gripper_open
            if grasps and self._random.random() < OVERSHOOT_SHARE:
                steps.append(self._overshoot(start, move))
            asked_m = (0.0 if changes else rounding_m) if move.within_m is None else move.within_m
            steps.append(GuidedMove(move, number, 0.0 if last else asked_m))
            start, gripper_open = move.pose, move.gripper_open
        return steps

    def _overshoot(self, start: ToolPose, move: Move) -> GuidedMove:
        """Past the pose before the grasp, level with it, in the direction of the motion there."""
        along = move.pose.position_m - start.position_m
        heading_rad = np.arctan2(along[1], along[0])
        beyond_m = self._random.uniform(*OVERSHOOT_M) * np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0])
        pose = ToolPose(move.pose.position_m + beyond_m, move.pose.rotation)
        return GuidedMove(Move(pose, move.gripper_open, move.straight), None, OVERSHOOT_WITHIN_M)

    def speeds_m_s(self, route: Route) -> Array:
        """The speed (K,) that the person would like to have at each of the route's points."""
        along_m = route.along_m
        num_phases = int(np.ceil(route.length_m / PHASE_M[0]))
        knots_m = np.concatenate([[0.0], np.cumsum(self._random.uniform(*PHASE_M, num_phases))])
        phases = self._random.uniform(*PHASE_PACE, len(knots_m))
        speeds = TOOL_SPEED_M_S * self._pace * np.interp(along_m, knots_m, phases)
        speeds[route.length_m - along_m < APPROACH_M] = APPROACH_SPEED_M_S
        for _ in range(self._random.integers(MAX_HESITATIONS, endpoint=True)):
            self._hesitate(route, speeds)
        return speeds

    def _hesitate(self, route: Route, speeds_m_s: Array) -> None:
        """Nearly stop where the arm is far from any pose of the plan, if the route has such a place."""
        at_m, length_m = self._random.uniform(0, route.length_m), self._random.uniform(*HESITATION_M)
        if min(abs(at_m - end_m) for end_m in (0.0, *route.ends_m)) > CLEAR_M:
            speeds_m_s[np.abs(route.along_m - at_m) < length_m / 2] = HESITATION_SPEED_M_S

    def grasp_lead_s(self, *, opens: bool) -> float:
        """How long before the hand arrives the gripper is commanded to close, or to open."""
        return RELEASE_LEAD_S if opens else self._random.uniform(*GRASP_LEAD_S)

    def on_the_way(self) -> float:
        """Where on its leg, as a share, a gripper is set that touches nothing."""
        return self._random.uniform(*ON_THE_WAY)


class GuidedPanda(SimulatedPanda):
    """A Panda that `perform`s moves as a person guides it; `execute` and the rest are a robot's own.

    Args:
        task, cameras: as for SimulatedPanda.
        habits: how the person guides it.
    """

    def __init__(self, task: SimTask, habits: Habits, cameras: Sequence[str] = ()) -> None:
        super().__init__(task, cameras)
        self._habits = habits
        self._finger_goal_m: float = task.data.ctrl[panda.GRIPPER_CTRL]
        self._fingers_move = False
        self._finger_address = task.model.joint(panda.FINGER_NAMES[0]).qposadr[0]
        self._finger_speed_address = task.model.joint(panda.FINGER_NAMES[0]).dofadr[0]
        self.after_step.append(self._move_fingers)

    @property
    def gripper_commanded_open(self) -> bool:
        return self._finger_goal_m > panda.FINGER_TRAVEL_M / 2

    def perform(self, moves: Sequence[Move]) -> None:
        start = self._kinematics.forward(self._target_rad)
        steps = self._habits.steps(start, self.gripper_commanded_open, moves)
        steps, paths = self._planned(steps)
        first = 0
        for end, step in enumerate(steps, start=1):
            if step.within_m == 0:
                self._pass(steps[first:end], paths[first:end], len(moves))
                first = end

    def _planned(self, steps: list[GuidedMove]) -> tuple[list[GuidedMove], list[JointPath]]:
        """The steps with their paths; without overshoots where these would keep the arm from a straight line."""
        plan = [step for step in steps if step.number is not None]
        try:
            paths = self._planner.plan(self._target_rad, [step.move for step in steps])
            if all(path.straight for step, path in zip(steps, paths, strict=True) if step.move.straight):
                return steps, paths
        except MotionError:
            pass  # the plan itself may be within reach; if it is not, the next line says so
        return plan, self._planner.plan(self._target_rad, [step.move for step in plan])

    def _pass(self, steps: Sequence[GuidedMove], paths: Sequence[JointPath], total: int) -> None:
        """Go along the paths without a rest, reach the last pose and set the gripper there."""
        route = joined(paths, [step.within_m for step in steps[:-1]], self._kinematics)
        pace = Pace(route, self._habits.speeds_m_s(route), TIMESTEP_S)
        *passed, reached = steps
        lead_s = self._habits.grasp_lead_s(opens=reached.move.gripper_open)
        lead_row = max(0, len(pace.motion.positions_rad) - round(lead_s / TIMESTEP_S))
        at_the_end: _Event = (lead_row, partial(self._command, reached))
        self._target_rad = paths[-1].end_rad
        self._run_with(pace.motion, [*self._on_the_way(passed, route.ends_m, pace), at_the_end])
        self._wait_for_fingers()
        assert reached.number is not None  # an overshoot is passed
        self._check_arrival(reached.move.pose, reached.number, total)
        self._end_move(reached.number)

    def _on_the_way(self, steps: Sequence[GuidedMove], ends_m: Sequence[float], pace: Pace) -> Iterator[_Event]:
        begin_m = 0.0
        for step, end_m in zip(steps, ends_m, strict=False):
            set_at_m = begin_m + self._habits.on_the_way() * (end_m - begin_m)
            yield pace.row_at(set_at_m), partial(self._command, step)
            if step.number is not None:
                yield pace.row_at(end_m), partial(self._end_move, step.number)
            begin_m = end_m

    def _run_with(self, motion: JointMotion, events: Sequence[_Event]) -> None:
        targets_rad = motion.positions_rad + VELOCITY_LEAD_S * motion.velocities_rad_s
        done = 0
        for row, act in sorted(events, key=lambda event: event[0]):
            self._run(targets_rad[done:row])
            done = row
            act()
        self._run(targets_rad[done:])

    def _command(self, step: GuidedMove) -> None:
        goal_m = panda.FINGER_TRAVEL_M if step.move.gripper_open else 0.0
        if goal_m != self._finger_goal_m:
            self._finger_goal_m, self._fingers_move = goal_m, True
            # Fingers that hold something are commanded further than they are; they turn back from where they are.
            self.task.data.ctrl[panda.GRIPPER_CTRL] = self.task.data.qpos[self._finger_address]

    def _move_fingers(self) -> None:
        """One simulation step's worth of the way to where the fingers are commanded."""
        ctrl, most_m = self.task.data.ctrl, FINGER_SPEED_M_S * TIMESTEP_S
        way_m = self._finger_goal_m - ctrl[panda.GRIPPER_CTRL]
        if way_m:
            ctrl[panda.GRIPPER_CTRL] += max(-most_m, min(most_m, way_m))

    def _wait_for_fingers(self) -> None:
        """If they were commanded to move: until they have done so, or hold something."""
        waited_s = 0.0
        while self._fingers_move and waited_s < GRIPPER_S:
            self.hold(WATCH_S)
            waited_s += WATCH_S
            self._fingers_move = not self._fingers_are_done()
        self._fingers_move = False

    def _fingers_are_done(self) -> bool:
        data = self.task.data
        if abs(data.qvel[self._finger_speed_address]) > FINGERS_AT_REST_M_S:
            return False
        asked_m = data.ctrl[panda.GRIPPER_CTRL]
        grips = not self.gripper_commanded_open and data.qpos[self._finger_address] - asked_m >= GRIP_M
        return bool(asked_m == self._finger_goal_m or grips)
