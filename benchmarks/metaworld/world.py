"""What this benchmark needs of a simulation; `simulator` has Meta-World's, the tests a small one."""

from collections.abc import Callable
from typing import Protocol

from benchmarks.metaworld.tasks import Command, Floats

OPEN, CLOSE = -1.0, 1.0  # the gripper's command


class World(Protocol):
    """The scenes of one task. Everything that happens follows from the seed and the actions.

    Attributes:
        step_hz: steps a second.
        max_steps: of a scene; after them it has failed.
    """

    step_hz: float
    max_steps: int

    def reset(self, seed: int) -> Floats:
        """Begin the scene of that seed; its observation (39)."""

    def step(self, command: Command) -> tuple[Floats, bool]:
        """Take one step; a command out of bounds is clipped.

        Returns:
            The observation (39), and whether the task is done.
        """

    def policy(self, observation: Floats) -> Command:
        """The command of the scripted policy."""

    def joint_velocities_rad_s(self) -> Floats:
        """Of the seven joints."""

    def close(self) -> None:
        """Free what the simulation holds."""


OpenWorld = Callable[[str], World]
"""The world of the task of that name."""
