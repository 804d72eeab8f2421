"""Meta-World itself: the only module that imports it."""

from importlib.metadata import version
from typing import Any

import numpy as np
from metaworld.env_dict import ALL_V3_ENVIRONMENTS_GOAL_OBSERVABLE
from metaworld.policies import ENV_POLICY_MAP

from benchmarks.metaworld.tasks import Command, Floats

NUM_JOINTS = 7


class MetaWorld:
    """A `World` of one of Meta-World's tasks, with its scripted policy and with the goal in the observation."""

    def __init__(self, task: str) -> None:
        make_env: Any = ALL_V3_ENVIRONMENTS_GOAL_OBSERVABLE[f"{task}-v3-goal-observable"]
        make_policy: Any = ENV_POLICY_MAP[f"{task}-v3"]
        self._env = make_env(seed=0)
        self._env._freeze_rand_vec, self._env.seeded_rand_vec = False, True  # every seed is a scene of its own
        self._policy = make_policy()
        self.step_hz = 1 / self._env.dt
        self.max_steps = self._env.max_path_length - 1  # Meta-World refuses the step after the last

    def reset(self, seed: int) -> Floats:
        self._env.seed(seed)
        return np.asarray(self._env.reset()[0], np.float64)

    def step(self, command: Command) -> tuple[Floats, bool]:
        observation, _, _, _, info = self._env.step(np.clip(command, -1, 1))
        return np.asarray(observation, np.float64), bool(info["success"])

    def policy(self, observation: Floats) -> Command:
        # a copy: three of the policies write into what they get
        return np.asarray(self._policy.get_action(observation.copy()))

    def joint_velocities_rad_s(self) -> Floats:
        return np.array(self._env.data.qvel[:NUM_JOINTS])

    def close(self) -> None:
        self._env.close()


def versions() -> dict[str, str]:
    """Of what a scene depends on."""
    return {package: version(package) for package in ("metaworld", "mujoco")}
