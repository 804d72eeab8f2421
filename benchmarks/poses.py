"""How well the estimator `cuboid` finds objects in rendered scenes with a depth camera's noise.

Object models are learned from the masks and poses of a few scenes, as from demonstrations; other scenes are the test,
each camera alone and both together. Run: ``python -m benchmarks.poses [--scenes 60]``.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from app.perception.base import LabeledScene, ObjectQuery
from app.perception.cuboid.estimator import CuboidPoses
from app.perception.cuboid.learn import learn_models
from app.perception.cuboid.model import CuboidModel
from app.pipeline.errors import NoPoseError
from app.pipeline.geometry import canonical_pose
from app.sim.demonstrate import view_scene
from app.sim.outcomes import SceneView
from app.sim.tasks.cubes import HALF_SIZE_M
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose
from synthetic.camera_noise import as_a_camera_sees_it

TASKS = ("stack_cube", "destack_cube", "push_button", "stack_blocks", "slide_block")
FIRST_TEST_SEED = 1000
WRONG_M = 0.02  # a pose that is further off is no pose of the object
Noisy = tuple[SceneView, tuple[RgbdFrame, ...]]


@dataclass
class Tally:
    """Errors of one kind of object in one kind of view."""

    errors_m: list[float] = field(default_factory=list)
    errors_deg: list[float] = field(default_factory=list)
    missed: int = 0
    wrong: int = 0
    flagged: int = 0

    def add(self, true: ObjectPose, found: ObjectPose, symmetry_deg: float | None) -> None:
        """Count a pose."""
        error_m = float(np.linalg.norm(found.position_m - true.position_m))
        if error_m > WRONG_M:
            self.wrong += 1
            self.flagged += bool(found.reason)
            return
        self.errors_m.append(error_m)
        if symmetry_deg != 0:
            assert true.quaternion_xyzw is not None
            assert found.quaternion_xyzw is not None
            offset = Rotation.from_quat(true.quaternion_xyzw).inv() * Rotation.from_quat(found.quaternion_xyzw)
            nearest = canonical_pose(ObjectPose("offset", np.zeros(3), offset.as_quat()), symmetry_deg)
            self.errors_deg.append(float(np.degrees(Rotation.from_quat(nearest.quaternion_xyzw).magnitude())))

    def summary(self) -> dict[str, float]:
        """Means and 95th percentiles in cm and degrees; missed and wrong objects per 1,000."""
        asked = len(self.errors_m) + self.missed + self.wrong
        errors_cm = 100 * np.array(self.errors_m)
        values = {"asked": float(asked), "missed_per_1000": 1000 * self.missed / asked}
        values |= {"wrong_per_1000": 1000 * self.wrong / asked, "wrong_with_a_reason": float(self.flagged)}
        for name, errors in (("cm", errors_cm), ("deg", np.array(self.errors_deg))):
            if len(errors):
                values |= {f"mean_{name}": float(errors.mean()), f"p95_{name}": float(np.percentile(errors, 95))}
        return values


def noisy_scenes(task: str, seeds: Sequence[int]) -> Iterator[Noisy]:
    """The task's scenes as depth cameras see them."""
    for seed in seeds:
        scene, random = view_scene(task, seed), np.random.default_rng((5, seed))
        yield scene, tuple(as_a_camera_sees_it(frame, random) for frame in scene.frames)


def learned(task: str, count: int) -> dict[str, CuboidModel]:
    """The task's object models, from scenes 0..count - 1."""
    return learn_models([LabeledScene(frames, _labeled(scene)) for scene, frames in noisy_scenes(task, range(count))])


def _labeled(scene: SceneView) -> tuple[ObjectQuery, ...]:
    return tuple(
        ObjectQuery(
            pose.name,
            tuple(pose.position_m),
            None if pose.quaternion_xyzw is None else tuple(pose.quaternion_xyzw),
            scene.mask_ids[pose.name],
        )
        for pose in scene.objects
    )


def kind_of(task: str, pose: ObjectPose) -> str:
    """What an object is reported as: cubes by their storey, all else by task and name's last word."""
    if task == "destack_cube":
        return "destack_cube, lower" if pose.position_m[2] < TABLE_TOP_M + 2 * HALF_SIZE_M else "destack_cube, upper"
    return f"{task}, {pose.name.split()[-1]}"


def measure(task: str, num_learned: int, num_scenes: int) -> tuple[dict[tuple[str, str], Tally], list[float]]:
    """Tallies by kind of object and view, and the CPU milliseconds that each image took."""
    models = learned(task, num_learned)
    queries = [ObjectQuery(name, model=model) for name, model in models.items()]
    tallies: dict[tuple[str, str], Tally] = defaultdict(Tally)
    times_ms: list[float] = []
    for scene, frames in noisy_scenes(task, range(FIRST_TEST_SEED, FIRST_TEST_SEED + num_scenes)):
        for view in (*((frame,) for frame in frames), frames):
            start_s = time.process_time()
            found = _found(queries, view)
            times_ms.append(1000 * (time.process_time() - start_s) / len(view))
            name = " + ".join(frame.camera.name for frame in view)
            for true in scene.objects:
                tally, pose = tallies[kind_of(task, true), name], found.get(true.name)
                if pose is None:
                    tally.missed += 1
                else:
                    tally.add(true, pose, models[true.name].yaw_symmetry_deg)
    return tallies, times_ms


def _found(queries: Sequence[ObjectQuery], view: Sequence[RgbdFrame]) -> dict[str, ObjectPose]:
    """All poses; where one is refused the others are asked for without it."""
    try:
        return {pose.name: pose for pose in CuboidPoses().estimate(queries, view)}
    except NoPoseError as error:
        kept = [query for query in queries if error.name not in _needed(query)]
        return _found(kept, view) if kept else {}


def _needed(query: ObjectQuery) -> set[str | None]:
    """The object, and those by which it is chosen."""
    assert isinstance(query.model, CuboidModel)
    return {query.name, query.model.away_from, query.model.rank.nearest_to if query.model.rank else None}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=60, help="test scenes of each task")
    parser.add_argument("--learn", type=int, default=6, help="scenes of each task that models are learned from")
    parser.add_argument("--tasks", nargs="+", default=TASKS, choices=TASKS)
    arguments = parser.parse_args()
    console = Console(width=140)
    columns = ["objects", "cameras", "asked", "cm", "p95", "degrees", "p95", "missed/1000", "wrong/1000", "flagged"]
    table = Table(*columns, title="cuboid: errors of learned models, 640x480, depth sigma 2 mm z^2")
    for task in arguments.tasks:
        tallies, times_ms = measure(task, arguments.learn, arguments.scenes)
        for (kind, view), tally in sorted(tallies.items()):
            values = tally.summary()
            table.add_row(kind, view, f"{values['asked']:.0f}", *_cells(values), f"{values['wrong_with_a_reason']:.0f}")
        console.print(f"{task}: {np.mean(times_ms):.1f} ms CPU an image, p95 {np.percentile(times_ms, 95):.1f}")
    console.print(table)


def _cells(values: dict[str, float]) -> list[str]:
    names = ("mean_cm", "p95_cm", "mean_deg", "p95_deg", "missed_per_1000", "wrong_per_1000")
    return [f"{values[name]:.3g}" if name in values else "-" for name in names]


if __name__ == "__main__":
    main()
