"""How well `registered` finds objects again in recorded episodes whose masks are known.

Each episode of a folder teaches each object in turn, and the object is looked for in all others. Run:
``python -m benchmarks.recorded_objects FOLDER [--objects frame+top] [--why]``. The folder has `.npz` files with, for
each of `cameras`, NAME_rgb, NAME_depth, NAME_mask, NAME_intrinsics_cv and NAME_extrinsics_cv (4, 4, camera to world);
`mask_names` with `mask_ids`; and `object_names` with `object_sim_pose` (x, y, z, quaternion xyzw; NaN: unknown).
"""

import argparse
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from app.perception.object_model import ObjectModelError
from app.perception.registered.estimator import RegisteredPoses, TaughtQuery
from app.perception.registered.learn import LabeledView, learn
from app.perception.registered.model import RegisteredModel
from app.perception.registered.scene import Scene
from app.perception.registered.template import Template
from app.pipeline.errors import NoPoseError
from app.pipeline.geometry import rigid
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame

NEAR_M = 0.01  # from a masked point to the found object
WRONG_COVER = 0.5  # a pose that explains less of the recorded mask is no pose of the object


@dataclass(frozen=True, eq=False)
class Recorded:
    """An episode's first images, and by object its mask id and its (4, 4) pose, if recorded."""

    name: str
    frames: tuple[RgbdFrame, ...]
    mask_ids: Mapping[str, int]
    poses: Mapping[str, Array]

    @classmethod
    def read(cls, path: Path) -> "Recorded":
        """An episode's file."""
        with np.load(path, allow_pickle=False) as data:
            frames = tuple(_frame(data, str(name)) for name in data["cameras"])
            ids = dict(zip(data["mask_names"].tolist(), data["mask_ids"].tolist(), strict=True))
            known = zip(data["object_names"].tolist(), data["object_sim_pose"], strict=True)
            poses = {name: rigid(pose[:3], pose[3:]) for name, pose in known if np.isfinite(pose).all()}
        return cls(path.stem, frames, ids, poses)

    def labeled(self, name: str) -> tuple[RgbdFrame, ...]:
        """The frames with 1 where the object is."""
        own = [self.mask_ids[part] for part in name.split("+")]
        return tuple(replace(frame, mask=np.isin(frame.mask, own).astype(np.int32)) for frame in self.frames)


def _frame(data: Mapping[str, Any], name: str) -> RgbdFrame:
    matrix = data[f"{name}_intrinsics_cv"]
    intrinsics = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
    camera = Camera(name, *map(float, intrinsics), data[f"{name}_extrinsics_cv"])
    return RgbdFrame(camera, data[f"{name}_rgb"], data[f"{name}_depth"], data[f"{name}_mask"])


def _cover(template: Template, pose: Array, seen: Recorded, name: str) -> float:
    """The share of the masked points above the table that lie on the found object."""
    scene = Scene.of(seen.labeled(name))
    points_m = scene.points_m[scene.masked()]
    off_m = template.distance_m((points_m - pose[:3, 3]) @ pose[:3, :3])
    return float((off_m < NEAR_M).mean()) if len(off_m) else 0.0


def measure(episodes: Sequence[Recorded], name: str) -> tuple[dict[str, Any], Counter[str]]:
    """A row of the table, and why there was no pose."""
    covers, errors_mm, errors_deg, wrong, untaught = [], [], [], 0, 0
    reasons = Counter[str]()
    for root in episodes:
        try:
            template = learn(name, [LabeledView(root.labeled(name))], None, needs_yaw=False).template
            (at_root,) = _found(name, template, root)
        except (ObjectModelError, NoPoseError) as error:
            untaught += 1
            reasons[f"not taught: {error.message}"] += 1
            continue
        for other in episodes:
            if other is root:
                continue
            try:
                (pose,) = _found(name, template, other)
            except NoPoseError as error:
                reasons[error.message] += 1
                continue
            covers.append(_cover(template, pose, other, name))
            wrong += covers[-1] < WRONG_COVER
            part = name.partition("+")[0]
            if part in root.poses and part in other.poses:
                true = other.poses[part] @ np.linalg.inv(root.poses[part]) @ at_root
                errors_mm.append(1000 * float(np.linalg.norm(pose[:3, 3] - true[:3, 3])))
                turn = Rotation.from_matrix(pose[:3, :3].T @ true[:3, :3])
                errors_deg.append(float(np.degrees(turn.magnitude())))
    asked = (len(episodes) - untaught) * (len(episodes) - 1)
    row = {"not taught": untaught, "asked": asked, "found": len(covers) - wrong, "wrong": wrong}
    row["refused"] = asked - len(covers)
    for label, values in (("cover %", 100 * np.array(covers)), ("mm", errors_mm), ("deg", errors_deg)):
        row[label] = f"{np.median(values):.1f} ({np.max(values):.1f})" if len(values) else ""
    return row, reasons


def _found(name: str, template: Template, seen: Recorded) -> tuple[Array]:
    """(4, 4) template -> world."""
    frames = [replace(frame, mask=None) for frame in seen.frames]
    query = TaughtQuery(name.partition("+")[0], model=RegisteredModel("0" * 64), template=template)
    (pose,) = RegisteredPoses().estimate([query], frames)
    assert pose.quaternion_xyzw is not None
    return (rigid(pose.position_m, pose.quaternion_xyzw),)


def main() -> int:
    """Print a table; the refusals with --why."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--objects", default="", help="separated by commas, parts of one by +; default: all")
    parser.add_argument("--why", action="store_true")
    options = parser.parse_args()
    episodes = [Recorded.read(path) for path in sorted(options.folder.glob("*.npz"))]
    names = options.objects.split(",") if options.objects else list(episodes[0].mask_ids)
    table: Table | None = None
    for name in names:
        row, reasons = measure(episodes, name)
        if table is None:
            table = Table("object", *row)
        table.add_row(name, *map(str, row.values()))
        if options.why:
            for reason, count in reasons.most_common():
                print(f"{name}, {count} times: {reason}", file=sys.stderr)  # noqa: T201
    Console(width=120).print(table or "no episodes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
