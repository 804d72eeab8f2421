"""The simulated Panda as a world, and what only it offers to an evaluation: pictures, shifted scenes, its robot."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

from app.pipeline.keyframes import Motion, merged
from app.pipeline.workspace import Workspace, discretize_actions, undiscretize_actions
from app.sim.demonstrate import Recordings, RobotName, record_demonstration, rollout, view_scene
from app.sim.libfranka import demonstrate as over_libfranka
from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from app.sim.tasks import ALL_TASKS
from app.sim.world import CAMERA_NAMES, CAMERAS
from roboprompt_client.types.poses import EndEffectorAction

Actions = tuple[EndEffectorAction, ...]


@dataclass(frozen=True)
class Panda:
    """The tasks of `app.sim.tasks`.

    Attributes:
        recordings: whether the expert rests at its poses while it demonstrates.
        robot: what moves the arm, in demonstrations and tests; a Franka's driver rests at each pose.
        control_frequency_hz: of the recordings; RLBench's by default.
        num_cameras: that take images, the first of `app.sim.world.CAMERAS`.
    """

    recordings: Recordings = "rests"
    robot: RobotName = "simulated"
    control_frequency_hz: float = 20.0
    num_cameras: int = len(CAMERA_NAMES)
    tasks: ClassVar[Mapping[str, Mapping[str, float]]] = {
        name: task.yaw_symmetry_deg for name, task in ALL_TASKS.items()
    }
    first_test_seed: ClassVar[int] = 100_000
    python: ClassVar[None] = None

    @property
    def _cameras(self) -> tuple[str, ...]:
        return tuple(CAMERAS)[: self.num_cameras]

    def conditions(self) -> Mapping[str, Any]:
        return asdict(self)

    def recorded_at(self, frequency_hz: float) -> "Panda":
        return replace(self, control_frequency_hz=frequency_hz)

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        # Pictures take longer than the simulation; `app.evaluation.illustrate` takes them later.
        if not images:
            return _view(task, seed)
        return view_scene(task, seed, variation=_variation(task, seed), cameras=self._cameras)

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        if self.robot == "franka":
            return over_libfranka.record_demonstration(task, seed, self.control_frequency_hz, images=images)
        return record_demonstration(
            task, seed, self.control_frequency_hz, images=images, recordings=self.recordings, cameras=self._cameras
        )

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        return record_demonstration(
            task, seed, variation=_variation(task, seed), images=False, recordings=self.recordings
        )

    def execute(self, scene: SceneView, actions: Sequence[EndEffectorAction]) -> RolloutResult:
        carry_out = over_libfranka.rollout if self.robot == "franka" else rollout
        return carry_out(scene.task, scene.seed, actions, variation=_variation(scene.task, scene.seed))


def binned_keyframes(task: str, seed: int) -> Actions:
    """The keyframes of the expert in a test's scene, after binning. Runs in a worker."""
    trajectory, workspace = Panda().solve(task, seed).trajectory, Workspace.rlbench()
    actions = [trajectory.action_at(index) for index in merged(Motion.of(trajectory))]
    binned = discretize_actions(actions, workspace)
    return tuple(undiscretize_actions([item.bins for item in binned], workspace))


def film(
    scene: SceneView, actions: Sequence[EndEffectorAction] | None, shift_m: float
) -> tuple[SceneView, RolloutResult | None]:
    """A test's scene with pictures, and the actions carried out in it once more, if any. Runs in a worker.

    Args:
        shift_m: how far its free objects are moved before that.
    """
    task, seed, variation = scene.task, scene.seed, _variation(scene.task, scene.seed)
    seen = view_scene(task, seed, variation=variation)
    if actions is None:
        return seen, None
    return seen, rollout(task, seed, actions, variation=variation, film_strip=True, shift_m=shift_m)


@lru_cache(maxsize=64)
def _view(task: str, seed: int) -> SceneView:
    return view_scene(task, seed, variation=_variation(task, seed), images=False)


def _variation(task: str, seed: int) -> int:
    return ALL_TASKS[task].test_variation(seed)


WORLD = Panda()
