"""What a benchmark is: a world of scenes with an expert that solves them. One evaluation drives every world.

The simulated Panda is a world (`app.evaluation.panda`); another is a module with a `WORLD` of this Protocol. A world
that needs packages of its own names the interpreter that has them: its module, and nothing else of it, is then imported
there as well.
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
    """Scenes, each determined by task and seed. Its methods run in worker processes, so that it can be pickled.

    The scene of a seed may be another one in a demonstration than in a test, where a task has variations.
    """

    @property
    def tasks(self) -> Mapping[str, Mapping[str, float]]:
        """By name, of each symmetric object the turn about its z axis that leaves it unchanged, in degrees."""

    @property
    def first_test_seed(self) -> int:
        """The first seed of unseen scenes, unless another is asked for."""

    @property
    def python(self) -> Path | None:
        """The interpreter of the world's own environment; None: it runs in that of the evaluation."""

    def conditions(self) -> Mapping[str, Any]:
        """What else the results depend on, for their record."""

    def recorded_at(self, frequency_hz: float) -> "World":
        """The same world with demonstrations recorded at another rate."""

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        """What a test's scene shows before the arm moves."""

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        """The expert in the scene of a demonstration. One that failed says so."""

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        """The same in the scene of a test, without pictures."""

    def execute(self, scene: SceneView, actions: Sequence[EndEffectorAction]) -> RolloutResult:
        """Carry actions out in the scene as it was, and judge the outcome."""


def world_named(module: str) -> World:
    """The `WORLD` of a module, e.g. ``benchmarks.metaworld.world``.

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
    """The job's result and the seconds that it took. Runs in a worker."""
    started = time.perf_counter()
    return job(*arguments), time.perf_counter() - started
