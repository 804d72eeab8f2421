"""How well the estimator `registered` finds objects in simulated scenes with a depth camera's noise.

Templates are taught from three labeled views each; other scenes are the test. Run:
``python -m benchmarks.objects [--scenes 40] [--conditions clean,clutter] [--cameras 3] [--objects mug,jar] [--why]``.
"""

import argparse
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from app.perception.object_model import ObjectModelError
from app.perception.registered.estimator import RegisteredPoses, TaughtQuery
from app.perception.registered.icp import angle_deg
from app.perception.registered.learn import LabeledView, learn
from app.perception.registered.model import RegisteredModel
from app.perception.registered.template import Template
from app.pipeline.errors import NoPoseError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose
from synthetic.object_scenes import Layout, Room, changed, sample
from synthetic.object_shapes import THINGS

WRONG_M, WRONG_DEG = 0.02, 20.0  # a pose that is further off is no pose of the object
NUM_VIEWS = 3
CHANGES = ("table", "gloss", "cloth", "touching")  # of the surroundings of one object alone
CONDITIONS = ("clean", "noise", "clutter", "hidden", "light", "absent", "two alike", *CHANGES)
COLUMNS = ("asked", "found", "refused", "wrong", "mm_median", "mm_p95", "deg_median", "deg_p95", "seconds")


@dataclass(frozen=True, eq=False)
class Taught:
    """A template, and where the object's origin is in its frame."""

    template: Template
    object_to_template: Array


@dataclass
class Tally:
    """What became of one object's questions under one condition."""

    errors_m: list[float] = field(default_factory=list)
    errors_deg: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    refused: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def row(self) -> dict[str, float]:
        """Counts, mm, degrees and seconds."""
        found, refused, wrong = len(self.errors_m), self.refused.total(), len(self.wrong)
        values = {"asked": found + refused + wrong, "found": found, "refused": refused, "wrong": wrong}
        for name, errors in (("mm", 1000 * np.array(self.errors_m)), ("deg", np.array(self.errors_deg))):
            if len(errors):
                values |= {f"{name}_median": float(np.median(errors)), f"{name}_p95": float(np.percentile(errors, 95))}
        return values | {"seconds": float(np.mean(self.seconds)) if self.seconds else 0.0}


def taught(
    room: Room,
    name: str,
    rng: np.random.Generator,
    num_cameras: int = 3,
    layouts: Sequence[Layout] = (),
    labeled: Callable[[Sequence[RgbdFrame]], tuple[RgbdFrame, ...]] = tuple,
) -> Taught:
    """The object from views of layouts, by default of three with others.

    Args:
        labeled: what a person makes of frames with perfect masks.
    """
    layouts = layouts or [sample(rng, [(name, 0), *others(rng, [name], 2)]) for _ in range(NUM_VIEWS)]
    views = [LabeledView(labeled(room.frames(layout, rng, of=(name, 0), num=num_cameras))) for layout in layouts]
    learned = learn(name, views, THINGS[name].symmetry_deg, needs_yaw=False)
    true = layouts[learned.merged[0]].poses[name, 0]
    object_to_template = np.linalg.inv(_root_pose(learned.template, views[learned.merged[0]])) @ true
    if THINGS[name].symmetry_deg == 0:
        object_to_template[:2, 3] = 0.0  # its origin is to be on its axis, which does not turn with its unseen yaw
    return Taught(learned.template, object_to_template)


def _root_pose(template: Template, view: LabeledView) -> Array:
    """(4, 4) template -> world in the view that it began with."""
    frame = next(frame for frame in view.frames if frame.camera.name == template.free_views[0].camera.name)
    return frame.camera.camera_to_world @ np.linalg.inv(template.free_views[0].camera.camera_to_world)


def others(rng: np.random.Generator, names: Sequence[str], count: int) -> list[tuple[str, int]]:
    """Random other objects, the first of each kind."""
    free = [name for name in THINGS if name not in names and name != "drawer"]
    return [(str(name), 0) for name in rng.choice(free, count, replace=False)]


def scenes_of(
    condition: str, names: Sequence[str], count: int, rng: np.random.Generator
) -> Iterator[tuple[Layout, list[str]]]:
    """Layouts, and the objects to be asked for in each; each object is asked for `count` times."""
    for _ in range(count):
        for name in names:
            match condition:
                case "absent":
                    yield sample(rng, others(rng, [name], 3), num_clutter=3), [name]
                case "two alike":
                    yield sample(rng, [(name, 0), (name, 1), *others(rng, [name], 1)], num_clutter=2), [name]
                case "hidden":
                    yield sample(rng, [(name, 0), *others(rng, [name], 1)], num_clutter=2, hide=True), [name]
                case _ if condition in CHANGES:
                    alone = sample(rng, [(name, 0)], num_clutter=0)
                    yield changed(alone, name, condition, rng), [name]
                case _:
                    clutter = 0 if condition in ("clean", "noise") else 3
                    targets = [(name, 0), *others(rng, [name], 2)]
                    yield sample(rng, targets, num_clutter=clutter, light=condition == "light"), [name]


def ask(
    room: Room, templates: Mapping[str, Taught], condition: str, count: int, seed: int, num_cameras: int
) -> dict[str, Tally]:
    """The tallies of each object."""
    rng, tallies = np.random.default_rng((seed, CONDITIONS.index(condition))), defaultdict[str, Tally](Tally)
    for layout, asked in scenes_of(condition, list(templates), count, rng):
        frames = room.frames(layout, rng, noise=condition != "clean", num=num_cameras)
        for name in asked:
            true = None if condition in ("absent", "two alike") else layout.poses[name, 0]
            question(tallies[name], name, templates[name], frames, true)
    return dict(tallies)


def question(tally: Tally, name: str, taught: Taught, frames: Sequence[RgbdFrame], true: Array | None) -> None:
    """Ask for one object; `true` is its pose (4, 4), None where any answer is wrong."""
    symmetric = THINGS[name].symmetry_deg
    model = RegisteredModel("0" * 64, "none" if symmetric is None else "yaw" if symmetric == 0 else symmetric)
    query = TaughtQuery(name, model=model, template=taught.template)
    begun = time.process_time()
    try:
        (pose,) = RegisteredPoses().estimate([query], frames)
    except (NoPoseError, InvalidInputError) as error:
        tally.refused[error.message] += 1
    else:
        _judge(tally, name, pose, true, taught)
    tally.seconds.append(time.process_time() - begun)


def _judge(tally: Tally, name: str, pose: ObjectPose, true: Array | None, taught: Taught) -> None:
    symmetric = THINGS[name].symmetry_deg
    if true is None:
        tally.wrong.append(f"given at {pose.position_m.round(3).tolist()}, confidence {pose.confidence}")
        return
    found = np.eye(4)
    found[:3, 3] = pose.position_m
    if pose.quaternion_xyzw is not None:
        found[:3, :3] = Rotation.from_quat(pose.quaternion_xyzw).as_matrix()
    template_to_object = np.linalg.inv(taught.object_to_template)
    equal = [true @ roll @ template_to_object for roll in THINGS[name].rolls]
    off_deg, off_m = min(
        (angle_deg(found[:3, :3], pose[:3, :3], symmetric), float(np.linalg.norm(found[:3, 3] - pose[:3, 3])))
        for pose in equal
    )
    if off_m > WRONG_M or off_deg > WRONG_DEG:
        tally.wrong.append(f"off by {1000 * off_m:.0f} mm, {off_deg:.0f} degrees, confidence {pose.confidence}")
        return
    tally.errors_m.append(off_m)
    if symmetric != 0:
        tally.errors_deg.append(off_deg)


def main() -> int:
    """Print a table per condition; the refusals and wrong poses with --why."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenes", type=int, default=10, help="a condition and object")
    parser.add_argument("--conditions", default=",".join(CONDITIONS))
    parser.add_argument("--objects", default=",".join(THINGS))
    parser.add_argument("--cameras", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--why", action="store_true")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    room, templates = Room(options.seed), {}
    for number, name in enumerate(options.objects.split(",")):
        try:
            templates[name] = taught(room, name, np.random.default_rng((options.seed, 99, number)), options.cameras)
        except ObjectModelError as error:
            print(f"not taught: {error}", file=sys.stderr)  # noqa: T201
    for condition in options.conditions.split(","):
        show(condition, ask(room, templates, condition, options.scenes, options.seed, options.cameras), options.why)
    return 0


def show(condition: str, tallies: Mapping[str, Tally], why: bool) -> None:
    """Print a table; the refusals and wrong poses with `why`."""
    table = Table("object", *COLUMNS, title=condition)
    for name, tally in tallies.items():
        row = tally.row()
        table.add_row(name, *(f"{row[column]:.4g}" if column in row else "" for column in COLUMNS))
        for reason in (*(f"WRONG {item}" for item in tally.wrong), *tally.refused) if why else ():
            print(f"{condition}, {name}: {reason}", file=sys.stderr)  # noqa: T201
    Console(width=120).print(table)


if __name__ == "__main__":
    sys.exit(main())
