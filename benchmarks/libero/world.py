"""LIBERO as a world of the evaluation: `roboprompt eval --world benchmarks.libero.world`.

A scripted expert demonstrates (`expert`). Predicted actions are carried out by robosuite's controller in LIBERO's own
initial states and by its own criterion of success. It runs in an environment of its own, as LIBERO needs another
robosuite.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from benchmarks.libero.expert import plan
from benchmarks.libero.scene import FIRST_TEST_SEED, Scene
from benchmarks.robosuite.arm import CONTROL_HZ, Arm, demonstrated
from roboprompt_client.types.poses import EndEffectorAction, Pose

# By suite, the numbers of the tasks that the expert can demonstrate: things are taken and put somewhere.
TASKS = {
    "object": range(10),
    "spatial": (0, 1, 2, 3, 6, 7, 8, 9),
    "goal": (1, 2, 4, 6, 8, 9),
    "long": (0, 1, 4, 5, 6, 7),
}


@dataclass(frozen=True)
class Libero:
    """Tasks of LIBERO's suites Object, Spatial, Goal and Long (LIBERO-10), e.g. ``spatial_3``."""

    tasks: ClassVar[Mapping[str, Mapping[str, float]]] = {
        f"{suite}_{number}": {} for suite, numbers in TASKS.items() for number in numbers
    }
    first_test_seed: ClassVar[int] = FIRST_TEST_SEED
    has_cameras: ClassVar[bool] = True
    python: ClassVar[Path | None] = Path(__file__).parent / ".venv" / "bin" / "python"

    def conditions(self) -> Mapping[str, Any]:
        return {"world": "libero", "control_frequency_hz": CONTROL_HZ}

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        return _view(seed, Scene(task, seed), images)

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        scene = Scene(task, seed)
        return demonstrated(_view(seed, scene, images), scene, plan(scene))

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        return self.demonstrate(task, seed)

    def execute(self, scene: SceneView, actions: Sequence[EndEffectorAction]) -> RolloutResult:
        """Straight from one pose to the next."""
        return Arm(Scene(scene.task, scene.seed)).carry_out(actions)


WORLD = Libero()


def _view(seed: int, scene: Scene, images: bool) -> SceneView:
    """Return the scene as the poses of all objects, or as images, in which those of the task are to be found."""
    hand, objects = Pose(scene.hand_m, scene.hand.as_quat()), scene.objects()
    if not images:
        return SceneView(scene.task, seed, scene.instruction, tuple(objects.values()), (), {}, hand)
    from benchmarks.robosuite.cameras import look

    wanted = [id_ for id_ in objects if id_ in scene.env.obj_of_interest]
    frames = look(scene, scene.env.workspace_offset, [scene.body_of(id_) for id_ in wanted], seed)
    mask_ids: dict[str, tuple[int, ...]] = {objects[id_].name: (k,) for k, id_ in enumerate(wanted, start=1)}
    return SceneView(scene.task, seed, scene.instruction, tuple(objects[id_] for id_ in wanted), frames, mask_ids, hand)
