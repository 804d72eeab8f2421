"""Worlds: the Protocol of a benchmark (scenes, and an expert that solves them), and the simulated Panda as one.

Another world is a module with a `WORLD`. One that needs other packages names the interpreter that has them; only its
module is imported there.
"""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Protocol

from app.pipeline.keyframes import Motion, merged
from app.pipeline.workspace import Workspace, discretize_actions, undiscretize_actions
from app.sim.demonstrate import Recordings, record_demonstration, rollout, view_scene
from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from app.sim.tasks import ALL_TASKS
from app.sim.world import CAMERA_NAMES, CAMERAS
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction

Actions = Sequence[EndEffectorAction]


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
    def has_cameras(self) -> bool:
        """Whether `view` and `demonstrate` can return images."""

    @property
    def python(self) -> Path | None:
        """The interpreter of the world's environment; None: that of the evaluation."""

    def conditions(self) -> Mapping[str, Any]:
        """Return further conditions that change results, for their record."""

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        """Return a test's scene before the arm moves."""

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        """Return a demonstration by the expert, which may have failed."""

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        """Return the expert's attempt in a test's scene, without pictures."""

    def execute(self, scene: SceneView, actions: Actions) -> RolloutResult:
        """Carry out the actions in the scene, and judge the outcome."""


def world_named(module: str) -> World:
    """Return the `WORLD` of a module, e.g. ``benchmarks.metaworld.world``.

    Raises:
        InvalidInputError: if there is none, or its environment is missing.
    """
    try:
        world: World = importlib.import_module(module).WORLD
    except (ImportError, AttributeError) as error:
        raise InvalidInputError("world", f"{module} is no module with a WORLD: {error}") from error
    if world.python is not None and not world.python.exists():
        raise InvalidInputError("world", f"{module} needs an environment of its own: there is none at {world.python}")
    return world


@dataclass(frozen=True)
class Panda:
    """The tasks of `app.sim.tasks`.

    Attributes:
        recordings: whether the expert rests at its poses while it demonstrates.
        num_cameras: that take images, the first of `app.sim.world.CAMERAS`.
    """

    recordings: Recordings = "rests"
    num_cameras: int = len(CAMERA_NAMES)
    tasks: ClassVar[Mapping[str, Mapping[str, float]]] = {
        name: task.yaw_symmetry_deg for name, task in ALL_TASKS.items()
    }
    first_test_seed: ClassVar[int] = 100_000
    has_cameras: ClassVar[bool] = True
    python: ClassVar[None] = None

    @property
    def _cameras(self) -> tuple[str, ...]:
        return tuple(CAMERAS)[: self.num_cameras]

    def conditions(self) -> Mapping[str, Any]:
        return asdict(self)

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        if images:
            return view_scene(task, seed, variation=_variation(task, seed), cameras=self._cameras)
        return _view(task, seed)

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        return record_demonstration(task, seed, recordings=self.recordings, cameras=self._cameras if images else ())

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        variation = _variation(task, seed)
        return record_demonstration(task, seed, variation=variation, recordings=self.recordings, cameras=())

    def execute(self, scene: SceneView, actions: Actions) -> RolloutResult:
        return rollout(scene.task, scene.seed, actions, variation=_variation(scene.task, scene.seed))


WORLD = Panda()


def binned_keyframes(task: str, seed: int) -> tuple[EndEffectorAction, ...]:
    """Return the expert's keyframes in a test's scene, after binning. Runs in a worker."""
    trajectory, workspace = WORLD.solve(task, seed).trajectory, Workspace.rlbench()
    actions = [trajectory.action_at(index) for index in merged(Motion.of(trajectory))]
    binned = discretize_actions(actions, workspace)
    return tuple(undiscretize_actions([item.bins for item in binned], workspace))


@lru_cache(maxsize=64)
def _view(task: str, seed: int) -> SceneView:
    return view_scene(task, seed, variation=_variation(task, seed), cameras=())


def _variation(task: str, seed: int) -> int:
    return ALL_TASKS[task].test_variation(seed)
