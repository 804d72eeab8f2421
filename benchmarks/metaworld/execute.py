"""Keyframes on Meta-World's arm: straight from one to the next."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.metaworld.tasks import HAND, Floats
from benchmarks.metaworld.world import CLOSE, OPEN, World

GAIN_PER_M = 10.0  # of the hand's command, which is clipped to a step's length
TOLERANCE_M, PRECISE_M = 0.01, 0.005  # on the way; where the gripper switches and at the end
MOVE_STEPS, GRIP_STEPS = 60, 15


def execute(world: World, seed: int, actions: Sequence[Mapping[str, Any]]) -> tuple[bool, int]:
    """Execute actions of the service in the scene of that seed.

    Args:
        actions: each with `position` in metres and `gripper_open`; rotations are left out, as the hand cannot turn.

    Returns:
        Whether the task was done at any step, and after how many.
    """
    arm = _Arm(world, seed)
    for number, action in enumerate(actions, start=1):
        target_m = np.asarray(action["position"], np.float64)
        command, last = OPEN if action["gripper_open"] else CLOSE, number == len(actions)
        settles = last or command != arm.gripper
        arm.move(target_m, MOVE_STEPS, PRECISE_M if settles else TOLERANCE_M)
        if settles:
            arm.gripper = command
            arm.move(target_m, GRIP_STEPS * (2 if last else 1), tolerance_m=None)
    return arm.done, arm.steps


class _Arm:
    """The hand under way in a scene; once the task is done or the steps are used up it stays."""

    def __init__(self, world: World, seed: int) -> None:
        self._world = world
        self._hand_m = world.reset(seed)[HAND]
        self.gripper = OPEN
        self.steps = 0
        self.done = False

    def move(self, target_m: Floats, max_steps: int, tolerance_m: float | None) -> None:
        """Towards a position (3); without a tolerance all steps are taken."""
        for _ in range(max_steps):
            error_m = target_m - self._hand_m
            arrived = tolerance_m is not None and np.linalg.norm(error_m) < tolerance_m
            if arrived or self.done or self.steps >= self._world.max_steps:
                return
            observation, self.done = self._world.step(np.append(np.clip(GAIN_PER_M * error_m, -1, 1), self.gripper))
            self._hand_m = observation[HAND]
            self.steps += 1
