"""What a laboratory has and `benchmarks.objects` has not: arms in view, bumped cameras, old pictures, careless labels.

Each case asks for an object that is there, and again where it is absent. It must be found, or refused: any answer where
it is absent, or more than 2 cm or 20 degrees off, is wrong. Run:
``python -m benchmarks.object_attacks [--scenes 2] [--attacks arm,stale] [--objects mug,jar] [--seed 1] [--why]``.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.object_model import ObjectModelError
from benchmarks.objects import Tally, Taught, others, question, show, taught
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from synthetic.object_scenes import Layout, Room, sample, upright
from synthetic.object_shapes import PROPS, THINGS

BUMP_DEG, BUMP_M = 1.0, 0.01
HOLES = (0.3, 0.7)  # of an object's pixels
HELD_M = 0.15
SHELF_M = 0.1
LEAK_PX = 9  # 1.3 cm
NEIGHBOR_PX, NEIGHBOR_M = 45, 0.008

Frames = tuple[RgbdFrame, ...]


@dataclass(frozen=True, eq=False)
class Case:
    """A scene before pictures are taken: what stands where, and which object will be asked for."""

    room: Room
    name: str
    layout: Layout
    rng: np.random.Generator

    def frames(self, layout: Layout | None = None) -> Frames:
        """The pictures, with the object's mask."""
        return self.room.frames(layout or self.layout, self.rng, of=(self.name, 0))

    def place_m(self) -> Array:
        """(3,) of the object; of a random place where it is absent."""
        pose = self.layout.poses.get((self.name, 0))
        return np.append(self.rng.uniform(-0.15, 0.15, 2), 0.0) if pose is None else pose[:3, 3].copy()

    def one(self) -> int:
        """A random camera."""
        return int(self.rng.integers(3))


def _changed(frames: Frames, number: int, change: Callable[[RgbdFrame], RgbdFrame]) -> Frames:
    return (*frames[:number], change(frames[number]), *frames[number + 1 :])


def _turned(place_m: Array, *euler_deg: float) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_euler("xyz", euler_deg, degrees=True).as_matrix(), place_m
    return pose


def arm(case: Case) -> Frames:
    """A person's arm that reaches to the object, from 4 to 20 cm above the table."""
    place_m = case.place_m() + np.append(case.rng.uniform(-0.08, 0.08, 2), case.rng.uniform(0.06, 0.2))
    case.layout.poses["arm", 0] = _turned(place_m, 0, case.rng.uniform(-25, 0), case.rng.uniform(-180, 180))
    return case.frames()


def hand_around(case: Case) -> Frames:
    """The gripper around the object, open, before it closes."""
    case.layout.poses["gripper", 0] = upright(*case.place_m()[:2], case.rng.uniform(-np.pi, np.pi))
    case.layout.poses["gripper", 0][2, 3] = 0.03
    return case.frames()


def held(case: Case) -> Frames:
    """The object in the air, in the gripper."""
    place_m = case.place_m()
    if (case.name, 0) in case.layout.poses:
        case.layout.poses[case.name, 0][2, 3] += HELD_M
    case.layout.poses["gripper", 0] = upright(*place_m[:2], case.rng.uniform(-np.pi, np.pi))
    case.layout.poses["gripper", 0][2, 3] = HELD_M + 0.03
    return case.frames()


def lying(case: Case) -> Frames:
    """The object on its side, or upside down."""
    pose = case.layout.poses.get((case.name, 0))
    if pose is not None:
        fall = ((90, 0), (-90, 0), (0, 90), (0, -90), (180, 0))[case.rng.integers(5)]
        case.layout.poses[case.name, 0] = _turned(pose[:3, 3], *fall, case.rng.uniform(-180, 180))
        case.layout.poses[case.name, 0][2, 3] -= case.room.lowest_m(case.layout, (case.name, 0))
    return case.frames()


def shelf(case: Case) -> Frames:
    """A second surface of 10 cm height, beside the object."""
    case.layout.poses["shelf", 0] = upright(case.place_m()[0] + case.rng.choice([-0.34, 0.34]), 0.0, 0.0)
    _lift(case.layout)
    return case.frames()


def on_shelf(case: Case) -> Frames:
    """The object on a second surface of 10 cm height."""
    case.layout.poses["shelf", 0] = upright(*case.place_m()[:2], case.rng.uniform(-np.pi, np.pi))
    _lift(case.layout)
    return case.frames()


def _lift(layout: Layout) -> None:
    """Put onto the shelf what would stand within it."""
    to_shelf = np.linalg.inv(layout.poses["shelf", 0])
    places_m = [pose[:3, 3] for (name, _), pose in layout.poses.items() if name in THINGS]
    for place_m in (*places_m, *(item[3] for item in layout.clutter)):
        if (np.abs(to_shelf[:2, :3] @ place_m + to_shelf[:2, 3]) < (0.2, 0.25)).all():
            place_m[2] += SHELF_M


def holes(case: Case) -> Frames:
    """No depth on shiny parts of the object: a part of it in each camera."""
    frames = list(case.frames())
    for number, frame in enumerate(frames):
        assert frame.depth_m is not None
        blobs = cv2.GaussianBlur(case.rng.standard_normal(frame.depth_m.shape), (0, 0), 12)
        mask = frame.mask != 0 if frame.mask is not None and frame.mask.any() else blobs > -np.inf
        shiny = mask & (blobs > np.quantile(blobs[mask], 1 - case.rng.uniform(*HOLES)))
        frames[number] = replace(frame, depth_m=np.where(shiny, 0, frame.depth_m).astype(np.float32))
    return tuple(frames)


def shadow(case: Case) -> Frames:
    """Half of the light on one side of a line across the object."""
    heading = case.rng.uniform(0, 2 * np.pi)
    normal, edge_m = np.array([np.cos(heading), np.sin(heading), 0.0]), case.place_m()
    frames = list(case.frames())
    for number, frame in enumerate(frames):
        assert frame.depth_m is not None
        assert frame.rgb is not None
        rows, columns = np.indices(frame.depth_m.shape).reshape(2, -1)
        points_m = frame.camera.deproject(rows, columns, np.where(frame.depth_m > 0, frame.depth_m, 1.0).ravel())
        dark = ((points_m - edge_m) @ normal < 0).reshape(frame.depth_m.shape)
        frames[number] = replace(frame, rgb=np.where(dark[..., None], frame.rgb // 2, frame.rgb).astype(np.uint8))
    return tuple(frames)


def half_out(case: Case) -> Frames:
    """The picture of one to three cameras ends in the middle of the object."""
    place_m = case.place_m()

    def cut(frame: RgbdFrame) -> RgbdFrame:
        assert frame.rgb is not None
        assert frame.depth_m is not None
        end = int(np.clip(frame.camera.project(place_m)[0][0], 100, 600))
        camera = replace(frame.camera, image_size_px=(end, frame.rgb.shape[0]))
        return RgbdFrame(camera, frame.rgb[:, :end].copy(), frame.depth_m[:, :end].copy())

    frames = case.frames()
    for number in case.rng.permutation(3)[: case.rng.integers(1, 4)].tolist():
        frames = _changed(frames, number, cut)
    return frames


def exposure(case: Case) -> Frames:
    """One camera exposes half or twice as long as the others."""
    factor = case.rng.choice([0.5, 2.0])
    return _recolored(case, lambda rgb: np.clip(rgb * factor, 0, 255).astype(np.uint8))


def swapped(case: Case) -> Frames:
    """One camera sends blue first."""
    return _recolored(case, lambda rgb: rgb[..., ::-1].copy())


def _recolored(case: Case, change: Callable[[Array], Array]) -> Frames:
    def changed(frame: RgbdFrame) -> RgbdFrame:
        assert frame.rgb is not None
        return replace(frame, rgb=change(frame.rgb))

    return _changed(case.frames(), case.one(), changed)


def bumped(case: Case) -> Frames:
    """One camera is turned by a degree and moved by a centimeter since its calibration."""
    axis, way = case.rng.normal(size=(2, 3))
    turn = Rotation.from_rotvec(np.radians(BUMP_DEG) * axis / np.linalg.norm(axis)).as_matrix()

    def moved(frame: RgbdFrame) -> RgbdFrame:
        pose = frame.camera.camera_to_world.copy()
        pose[:3, :3] = turn @ pose[:3, :3]
        pose[:3, 3] += BUMP_M * way / np.linalg.norm(way)
        return replace(frame, camera=replace(frame.camera, camera_to_world=pose))

    return _changed(case.frames(), case.one(), moved)


def stale(case: Case) -> Frames:
    """One camera gives its picture of the scene before, in which the object and all else stood elsewhere."""
    return _old(case, sample(case.rng, [(case.name, 0), *others(case.rng, [case.name], 2)], num_clutter=2))


def moved(case: Case) -> Frames:
    """One camera gives its picture from before the object alone was moved, by 3 to 8 cm, or taken away."""
    heading, before = case.rng.uniform(0, 2 * np.pi), replace(case.layout, poses=dict(case.layout.poses))
    pose = case.layout.poses.get((case.name, 0), upright(*case.place_m()[:2], heading)).copy()
    pose[:2, 3] += case.rng.uniform(0.03, 0.08) * np.array([np.cos(heading), np.sin(heading)])
    before.poses[case.name, 0] = pose
    return _old(case, before)


def _old(case: Case, before: Layout) -> Frames:
    old, number = case.frames(before), case.one()
    return _changed(case.frames(), number, lambda frame: old[number])


ATTACKS: Mapping[str, Callable[[Case], Frames]] = {
    attack.__name__: attack
    for attack in (
        *(arm, hand_around, held, lying, shelf, on_shelf, holes, shadow),
        *(half_out, exposure, bumped, stale, moved, swapped),
    )
}
LABELS = ("leaked", "shifted", "neighbor", "one_view", "two_lights")  # careless teaching, asked for in clutter


def _careless(kind: str) -> Callable[[Sequence[RgbdFrame]], Frames]:
    """What a careless click makes of frames with perfect masks."""

    def labeled(frames: Sequence[RgbdFrame]) -> Frames:
        return tuple(replace(frame, mask=_mask(kind, frame)) for frame in frames)

    return labeled


def _mask(kind: str, frame: RgbdFrame) -> Array | None:
    assert frame.mask is not None
    assert frame.depth_m is not None
    mask = frame.mask.astype(np.uint8)
    if kind == "leaked":
        mask = cv2.dilate(mask, np.ones((2 * LEAK_PX + 1,) * 2))
    if kind == "shifted":
        mask = np.roll(mask, (LEAK_PX, -LEAK_PX), axis=(0, 1))
    if kind == "neighbor":
        near = cv2.dilate(mask, np.ones((2 * NEIGHBOR_PX + 1,) * 2))
        rows, columns = np.nonzero(near & (frame.depth_m > 0))
        above = frame.camera.deproject(rows, columns, frame.depth_m[rows, columns])[:, 2] > NEIGHBOR_M
        mask[rows[above], columns[above]] = 1
    return mask.astype(np.int32)


def main() -> int:
    """Print a table per attack; the refusals and wrong poses with --why."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenes", type=int, default=2, help="an attack and object")
    parser.add_argument("--attacks", default=",".join((*ATTACKS, *LABELS)))
    parser.add_argument("--objects", default=",".join(THINGS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--why", action="store_true")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    room, names = Room(options.seed, (*THINGS, *PROPS)), options.objects.split(",")
    attacks = options.attacks.split(",")
    usual = _templates(room, names, options.seed, "") if set(attacks) & set(ATTACKS) else {}
    for attack in attacks:
        templates = usual if attack in ATTACKS else _templates(room, names, options.seed, attack)
        rng = np.random.default_rng((options.seed, *attack.encode()))
        present, absent = defaultdict[str, Tally](Tally), defaultdict[str, Tally](Tally)
        for name in [name for name in templates for _ in range(options.scenes)]:
            for tallies, targets in ((present, [(name, 0)]), (absent, [])):
                layout = sample(rng, [*targets, *others(rng, [name], 2)], num_clutter=2)
                case = Case(room, name, layout, rng)
                frames = ATTACKS[attack](case) if attack in ATTACKS else case.frames()
                question(tallies[name], name, templates[name], frames, layout.poses.get((name, 0)))
        show(attack, present, options.why)
        show(f"{attack}, absent", absent, options.why)
    return 0


def _templates(room: Room, names: Sequence[str], seed: int, labels: str) -> dict[str, Taught]:
    templates = {}
    for number, name in enumerate(names):
        rng = np.random.default_rng((seed, 98, number))
        targets = [(name, 0), *others(rng, [name], 2)]
        layouts = [sample(rng, targets, light=labels == "two_lights") for _ in range(1 if labels == "one_view" else 3)]
        if labels == "neighbor":  # the same box, at the same side
            layouts[:] = [_with_box(layout, name) for layout in layouts]
        try:
            templates[name] = taught(room, name, rng, layouts=layouts, labeled=_careless(labels))
        except ObjectModelError as error:
            print(f"{labels} not taught: {error}", file=sys.stderr)  # noqa: T201
    return templates


def _with_box(layout: Layout, name: str) -> Layout:
    pose = layout.poses[name, 0]
    place_m = pose[:3, 3] + (THINGS[name].radius_m + 0.02) * pose[:3, 1] + (0, 0, 0.03)
    yaw = float(np.arctan2(pose[1, 0], pose[0, 0]))
    alone = Layout({(name, 0): pose}, light=layout.light)
    alone.clutter.append((1, np.array([0.02, 0.02, 0.03]), "cyan", place_m, yaw))
    return alone


if __name__ == "__main__":
    sys.exit(main())
