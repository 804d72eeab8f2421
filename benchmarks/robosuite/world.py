"""robosuite as a world of the evaluation: `roboprompt eval --world benchmarks.robosuite.world`.

Scripted experts (`expert`) demonstrate, or people whose recordings are read from a folder (`people`). Predicted actions
are carried out by robosuite's own controller, in its own scenes and by its own criterion of success. It runs in an
environment of its own, since robosuite needs another numpy and mujoco than the simulated Panda.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from benchmarks.robosuite.arm import CONTROL_HZ, Arm, demonstrated
from benchmarks.robosuite.people import PEOPLE, recorded_by_people
from benchmarks.robosuite.scene import TASKS, Scene
from roboprompt_client.types.poses import EndEffectorAction, Pose


@dataclass(frozen=True)
class Robosuite:
    """Nine tasks of robosuite 1.5 with scripted demonstrations, and four with those of people.

    Attributes:
        recordings: the folder of people's recordings, from the variable ROBOSUITE_RECORDINGS; without it the tasks of
            people are left out.
    """

    recordings: Path | None = field(default_factory=lambda: _folder())
    first_test_seed: ClassVar[int] = 1000
    has_cameras: ClassVar[bool] = True
    python: ClassVar[Path | None] = Path(__file__).parent / ".venv" / "bin" / "python"

    @property
    def tasks(self) -> Mapping[str, Mapping[str, float]]:
        people = PEOPLE if self.recordings is not None else {}
        return {name: {} for name in (*(name for name, task in TASKS.items() if task.scripted), *people)}

    def conditions(self) -> Mapping[str, Any]:
        return {"world": "robosuite", "control_frequency_hz": CONTROL_HZ}

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        return _view(task, seed, _scene(task, seed), images)

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        if task in PEOPLE:
            assert self.recordings is not None
            return recorded_by_people(self.recordings, task, seed)
        return _solved(task, seed, images)

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        return _solved(task, seed)

    def execute(self, scene: SceneView, actions: Sequence[EndEffectorAction]) -> RolloutResult:
        """Straight from one pose to the next."""
        return Arm(_scene(scene.task, scene.seed)).carry_out(actions)


def _folder() -> Path | None:
    named = os.environ.get("ROBOSUITE_RECORDINGS")
    return None if named is None else Path(named)


WORLD = Robosuite()


def _simulated(task: str) -> str:
    """The task whose scenes those of a task of people are."""
    return PEOPLE[task].simulated if task in PEOPLE else task


def _scene(task: str, seed: int) -> Scene:
    return Scene(_simulated(task), seed)


def _view(task: str, seed: int, scene: Scene, images: bool = False) -> SceneView:
    """Return the scene as poses, or with the images of three depth cameras, and what these can see."""
    hand, words = Pose(scene.hand_m, scene.hand.as_quat()), scene.task.instruction
    if not images:
        return SceneView(task, seed, words, scene.objects(), (), {}, hand)
    from benchmarks.robosuite.cameras import look

    seen = [item for item in scene.task.bodies if item.visible]
    objects = tuple(pose for pose in scene.objects() if pose.name in {item.name for item in seen})
    mask_ids: dict[str, tuple[int, ...]] = {item.name: (number,) for number, item in enumerate(seen, start=1)}
    frames = look(scene, scene.task.looked_at_m, [item.body for item in seen], seed)
    return SceneView(task, seed, words, objects, frames, mask_ids, hand)


def _solved(task: str, seed: int, images: bool = False) -> RecordedDemonstration:
    from benchmarks.robosuite.expert import plan

    scene = _scene(task, seed)
    return demonstrated(_view(task, seed, scene, images), scene, plan(_simulated(task), scene))
