"""How a person guides an arm: never twice alike, seldom at rest. Drawn from a seed: a scene has one recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.pipeline.arrays import Array
from app.sim.moves import Move, Pose
from app.sim.route import Route

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


@dataclass(frozen=True, eq=False)
class Step:
    """A move as the person makes it.

    Attributes:
        number: the move's in the expert's plan; None for an overshoot, which the plan does not have.
        within_m: how far the move's pose may be passed; 0: it is reached.
    """

    move: Move
    number: int | None
    within_m: float


class Person:
    """One person's habits in the scene of a seed. Ask in the same order to get the same answers."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng((STREAM, seed))
        self._pace = self._random.uniform(*PACE)

    def choose(self, number: int) -> int:
        """One of several ways to do a task, 0..number - 1."""
        return int(self._random.integers(number))

    def steps(self, start: Pose, gripper_open: bool, moves: Sequence[Move]) -> list[Step]:
        """The moves with how closely each is passed, and overshoots before grasps.

        Args:
            start, gripper_open: of the arm before the first move.
        """
        steps: list[Step] = []
        for number, move in enumerate(moves):
            last = number == len(moves) - 1
            changes = move.gripper_open != gripper_open
            rounding_m = self._random.uniform(*ROUNDING_M)
            if not last and self._grasps(move, moves[number + 1]) and self._random.random() < OVERSHOOT_SHARE:
                steps.append(self._overshoot(start, move))
            asked_m = (0.0 if changes else rounding_m) if move.within_m is None else move.within_m
            steps.append(Step(move, number, 0.0 if last else asked_m))
            start, gripper_open = move.pose, move.gripper_open
        return steps

    @staticmethod
    def _grasps(before: Move, move: Move) -> bool:
        return before.gripper_open and not move.gripper_open

    def _overshoot(self, start: Pose, move: Move) -> Step:
        """Past the pose before the grasp, level with it, in the direction of the motion there."""
        along = move.pose.position_m - start.position_m
        heading_rad = np.arctan2(along[1], along[0])
        beyond_m = self._random.uniform(*OVERSHOOT_M) * np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0])
        pose = Pose(move.pose.position_m + beyond_m, move.pose.rotation)
        return Step(Move(pose, move.gripper_open, move.straight), None, OVERSHOOT_WITHIN_M)

    def speeds_m_s(self, route: Route) -> Array:
        """The speed (K,) that the person would like to have at each of the route's points."""
        along_m = route.along_m
        knots_m = np.concatenate([[0.0], np.cumsum(self._random.uniform(*PHASE_M, self._num_phases(route)))])
        phases = self._random.uniform(*PHASE_PACE, len(knots_m))
        speeds = TOOL_SPEED_M_S * self._pace * np.interp(along_m, knots_m, phases)
        speeds[route.length_m - along_m < APPROACH_M] = APPROACH_SPEED_M_S
        for _ in range(self._random.integers(MAX_HESITATIONS, endpoint=True)):
            self._hesitate(route, speeds)
        return speeds

    @staticmethod
    def _num_phases(route: Route) -> int:
        return int(np.ceil(route.length_m / PHASE_M[0]))

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
