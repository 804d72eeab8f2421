"""The Protocol of a benchmark: scenes, and an expert that solves them.

The simulated Panda is one (`app.evaluation.panda`); another is a module with a `WORLD` of this Protocol. A world that
needs other packages names the interpreter that has them; only its module is imported there.
"""

import importlib
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from app.evaluation.failures import UnknownWorldError
from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from roboprompt_client.types.poses import EndEffectorAction

Result = TypeVar("Result")


class World(Protocol):
    """Scenes, each determined by task and seed. Its methods run in worker processes, so it must be picklable.

    If a task has variations, a seed may give different scenes in demonstrations and in tests.
    """

    @property
    def tasks(self) -> Mapping[str, Mapping[str, float]]:
        """By task, the rotational symmetry about z (degrees) of each symmetric object."""

    @property
    def first_test_seed(self) -> int:
        """The default first seed of unseen scenes."""

    @property
    def python(self) -> Path | None:
        """The interpreter of the world's environment; None: that of the evaluation."""

    def conditions(self) -> Mapping[str, Any]:
        """Return further conditions that change results, for their record."""

    def recorded_at(self, frequency_hz: float) -> "World":
        """Return this world with demonstrations recorded at another rate."""

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        """Return a test's scene before the arm moves."""

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        """Return a demonstration by the expert, which may have failed."""

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        """Return the expert's attempt in a test's scene, without pictures."""

    def execute(self, scene: SceneView, actions: Sequence[EndEffectorAction]) -> RolloutResult:
        """Carry out the actions in the scene, and judge the outcome."""


def world_named(module: str) -> World:
    """Return the `WORLD` of a module, e.g. ``benchmarks.metaworld.world``.

    Raises:
        UnknownWorldError: if there is none.
    """
    try:
        world: World = importlib.import_module(module).WORLD
    except (ImportError, AttributeError) as error:
        raise UnknownWorldError(f"{module} is no module with a WORLD: {error}") from error
    if world.python is not None and not world.python.exists():
        raise UnknownWorldError(f"{module} needs an environment of its own, and there is none at {world.python}")
    return world


def timed(job: Callable[..., Result], /, *arguments: object) -> tuple[Result, float]:
    """Return the job's result and its duration in seconds. Runs in a worker."""
    started = time.perf_counter()
    return job(*arguments), time.perf_counter() - started
