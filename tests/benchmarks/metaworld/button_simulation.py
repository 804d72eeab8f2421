"""A small stand-in for Meta-World: a hand that goes where it is sent, and a button that it pinches."""

import numpy as np

from benchmarks.metaworld.tasks import FINGERS, GOAL, HAND, OBJECT_1

STEP_M = 0.01
NEAR_M = 0.02
FINGERS_STEP = 0.1
HOME_M = np.array([0.0, 0.6, 0.2])


class ButtonSimulation:
    """Done when the fingers have closed at the object. Seeds from `hopeless_from` on have their object out of reach.

    Attributes:
        commands: of all steps since the last reset.
    """

    step_hz, max_steps = 80.0, 150

    def __init__(self, hopeless_from=10**9):
        self.commands = []
        self._hopeless_from = hopeless_from

    def reset(self, seed):
        self.commands = []
        self._hand_m, self._fingers = HOME_M.copy(), 1.0
        reach_m = 0.1 if seed < self._hopeless_from else 9.0
        self.button_m = np.array([0.0, 0.6, 0.05]) + reach_m * np.random.default_rng(seed).uniform(0.5, 1, 3)
        return self._observation()

    def step(self, command):
        command = np.clip(command, -1, 1)
        self.commands.append(command)
        self._hand_m += STEP_M * command[:3]
        self._fingers = float(np.clip(self._fingers - FINGERS_STEP * command[3], 0, 1))
        near = np.linalg.norm(self.button_m - self._hand_m) < NEAR_M
        return self._observation(), bool(near and self._fingers < 0.45)

    def policy(self, observation):
        error_m = observation[OBJECT_1] - observation[HAND]
        arrived = np.linalg.norm(error_m) < NEAR_M / 2
        return np.append(np.clip(error_m / STEP_M, -1, 1), 1.0 if arrived else -1.0)

    def joint_velocities_rad_s(self):
        moves = bool(self.commands) and np.linalg.norm(self.commands[-1][:3]) > 0.3
        return np.full(7, 0.5 if moves else 0.0)

    def _observation(self):
        observation = np.zeros(39)
        observation[HAND], observation[FINGERS] = self._hand_m, self._fingers
        observation[OBJECT_1] = self.button_m
        observation[GOAL] = self.button_m - [0, 0, 0.05]
        return observation
