"""The simulated arm as if a person guided it: it passes the poses of a plan and stops only where something happens."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from app.client.robot import MotionError
from app.sim import panda
from app.sim.motion import JointMotion
from app.sim.moves import Move
from app.sim.person import Person, Step
from app.sim.planner import Path
from app.sim.robot import GRIPPER_S, VELOCITY_LEAD_S, SimulatedPanda
from app.sim.route import Pace, joined
from app.sim.tasks.base import SimTask
from app.sim.world import TIMESTEP_S

FINGER_SPEED_M_S = 0.1  # the Franka Hand's (data sheet)
FINGERS_AT_REST_M_S = 0.002
# Fingers that are commanded this much further grip with their full force
GRIP_M = panda.GRIP_FORCE_N / panda.GRIP_STIFFNESS
WATCH_S = 0.02  # how often the person looks whether the fingers have done it

_Event = tuple[int, Callable[[], None]]


class GuidedPanda(SimulatedPanda):
    """A Panda that `perform`s moves as a person guides it; `execute` and the rest are a robot's own.

    Args:
        task, cameras: as for SimulatedPanda.
        person: whose habits.
    """

    def __init__(self, task: SimTask, person: Person, cameras: Sequence[str] = ()) -> None:
        super().__init__(task, cameras)
        self._person = person
        self._finger_goal_m: float = task.data.ctrl[panda.GRIPPER_CTRL]
        self._fingers_move = False
        self._finger_address = task.model.joint(panda.FINGER_NAMES[0]).qposadr[0]
        self._finger_speed_address = task.model.joint(panda.FINGER_NAMES[0]).dofadr[0]
        self.after_step.append(self._move_fingers)

    @property
    def gripper_commanded_open(self) -> bool:
        return self._finger_goal_m > panda.FINGER_TRAVEL_M / 2

    def perform(self, moves: Sequence[Move], on_done: Callable[[int], None] | None = None) -> None:
        start = self._kinematics.forward(self._target_rad)
        steps = self._person.steps(start, self.gripper_commanded_open, moves)
        steps, paths = self._planned(steps)
        first = 0
        for end, step in enumerate(steps, start=1):
            if step.within_m == 0:
                self._pass(steps[first:end], paths[first:end], len(moves), on_done)
                first = end

    def _planned(self, steps: list[Step]) -> tuple[list[Step], list[Path]]:
        """The steps with their paths; without overshoots where these would keep the arm from a straight line."""
        plan = [step for step in steps if step.number is not None]
        try:
            paths = self._planner.plan(self._target_rad, [step.move for step in steps])
            if all(path.straight for step, path in zip(steps, paths, strict=True) if step.move.straight):
                return steps, paths
        except MotionError:
            pass  # the plan itself may be within reach; if it is not, the next line says so
        return plan, self._planner.plan(self._target_rad, [step.move for step in plan])

    def _pass(
        self, steps: Sequence[Step], paths: Sequence[Path], total: int, on_done: Callable[[int], None] | None
    ) -> None:
        """Go along the paths without a rest, reach the last pose and set the gripper there."""
        route = joined(paths, [step.within_m for step in steps[:-1]], self._kinematics)
        pace = Pace(route, self._person.speeds_m_s(route), TIMESTEP_S)
        *passed, reached = steps
        lead_s = self._person.grasp_lead_s(opens=reached.move.gripper_open)
        lead_row = max(0, len(pace.motion.positions_rad) - round(lead_s / TIMESTEP_S))
        at_the_end: _Event = (lead_row, partial(self._command, reached))
        self._target_rad = paths[-1].end_rad
        self._run_with(pace.motion, [*self._on_the_way(passed, route.ends_m, pace, on_done), at_the_end])
        self._wait_for_fingers()
        assert reached.number is not None  # an overshoot is passed
        self._check_arrival(reached.move.pose, reached.number, total)
        if on_done is not None:
            on_done(reached.number)

    def _on_the_way(
        self, steps: Sequence[Step], ends_m: Sequence[float], pace: Pace, on_done: Callable[[int], None] | None
    ) -> Iterator[_Event]:
        begin_m = 0.0
        for step, end_m in zip(steps, ends_m, strict=False):
            set_at_m = begin_m + self._person.on_the_way() * (end_m - begin_m)
            yield pace.row_at(set_at_m), partial(self._command, step)
            if on_done is not None and step.number is not None:
                yield pace.row_at(end_m), partial(on_done, step.number)
            begin_m = end_m

    def _run_with(self, motion: JointMotion, events: Sequence[_Event]) -> None:
        targets_rad = motion.positions_rad + VELOCITY_LEAD_S * motion.velocities_rad_s
        done = 0
        for row, act in sorted(events, key=lambda event: event[0]):
            self._run(targets_rad[done:row])
            done = row
            act()
        self._run(targets_rad[done:])

    def _command(self, step: Step) -> None:
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
