"""Everyday objects of simple shapes on a table, as three depth cameras see them whose calibration is a little off."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import app.sim  # noqa: F401 - chooses OpenGL, which MuJoCo reads when it is imported

# isort: split
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.scene import COLORS, SceneBody, about_z
from app.sim.world import CameraPlacement, camera_to_world
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame
from synthetic.camera_noise import as_d435, miscalibrated
from synthetic.object_shapes import PROPS, THINGS

WIDTH_PX, HEIGHT_PX, FOCAL_PX = 640, 480, 600.0
SIZE_PX = HEIGHT_PX, WIDTH_PX
AREA_M = np.array([0.23, 0.18])  # half sizes of where objects stand, around the origin
GAP_M = 0.008  # least distance between two objects' circles
AWAY_M = np.array([0.0, 0.0, -3.0])  # where bodies wait that are not in the scene
MAX_TRIALS = 400
RANGE_M = 10.0
CAMERAS = {"front": (-90.0, 45.0, 0.80), "left": (160.0, 42.0, 0.90), "right": (20.0, 48.0, 0.75)}
NUM_CLUTTER = 8
GLOSS, GLOSS_EXPONENT = 0.9, 40
CLOTH_M = 0.004
TABLE, ROOM = (0.62, 0.55, 0.45), (0.8, 0.85, 0.9)
CLUTTER_COLORS = tuple(COLORS)


@dataclass
class Layout:
    """Where everything stands.

    Attributes:
        poses: (4, 4) by (object, number 0 or 1).
        clutter: (number, half sizes in m, color, place (3,), yaw).
        light: direction (3,), and factors (3,) of brightness per color.
        table_rgb: (3,) 0..1.
        has_gloss: whether the light is mirrored in everything but the table.
    """

    poses: dict[tuple[str, int], Array] = field(default_factory=dict)
    clutter: list[tuple[int, Array, str, Array, float]] = field(default_factory=list)
    light: tuple[Array, Array] = (np.array([-0.25, 0.2, -1.0]), np.ones(3))
    table_rgb: tuple[float, ...] = TABLE
    has_gloss: bool = False


class Room:
    """One model with two of every object, clutter, and three cameras; rays are cast, so that no OpenGL is needed."""

    def __init__(self, seed: int = 0, names: Sequence[str] = tuple(THINGS)) -> None:
        spec = mujoco.MjSpec()
        table = spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.7, 0.7, 0.02])
        table.pos, table.rgba = [0, 0, -0.02], [*TABLE, 1]
        for name in names:
            for number in (0, 1):
                part = SceneBody(spec.worldbody, f"{name} {number}", AWAY_M)
                part.body.mocap = True
                ({**THINGS, **PROPS})[name].build(part)
        for number in range(NUM_CLUTTER):
            part = SceneBody(spec.worldbody, f"clutter {number}", AWAY_M)
            part.body.mocap = True
            (part.box((0.02,) * 3, "red") if number % 2 else part.cylinder(0.02, 0.02, "red"))
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        rng = np.random.default_rng(seed)
        self.cameras = tuple(_camera(name, *place) for name, place in CAMERAS.items())
        self.calibrated = tuple(miscalibrated(camera, rng) for camera in self.cameras)

    def place(self, layout: Layout) -> None:
        """Move everything to where the layout says."""
        self._data.mocap_pos[:] = AWAY_M
        self._model.geom_rgba[0, :3] = layout.table_rgb
        for (name, number), pose in layout.poses.items():
            self._move(f"{name} {number}", pose[:3, 3], Rotation.from_matrix(pose[:3, :3]))
        for number, half_m, color, place_m, yaw in layout.clutter:
            body = self._model.body(f"clutter {number}")
            geom = body.geomadr[0]
            self._model.geom_size[geom] = half_m
            self._model.geom_rbound[geom] = np.linalg.norm(half_m)
            self._model.geom_aabb[geom, 3:] = half_m if number % 2 else half_m[[0, 0, 1]]
            self._model.geom_rgba[geom, :3] = COLORS[color]
            self._move(f"clutter {number}", place_m, about_z(yaw))
        mujoco.mj_forward(self._model, self._data)

    def lowest_m(self, layout: Layout, key: tuple[str, int]) -> float:
        """The z of the lowest corner of the boxes around an object's shapes."""
        self.place(layout)
        body = self._model.body("{} {}".format(*key)).id
        corners = np.array(list(product((-1, 1), repeat=3)))
        geoms = np.flatnonzero(self._model.geom_bodyid == body)
        boxes = self._model.geom_aabb[geoms]
        local = boxes[:, None, :3] + corners * boxes[:, None, 3:]
        axes = self._data.geom_xmat[geoms].reshape(-1, 3, 3)
        return float((np.einsum("gij,gcj->gci", axes, local) + self._data.geom_xpos[geoms][:, None])[..., 2].min())

    def shoot(self, layout: Layout, number: int, of: tuple[str, int] | None = None) -> RgbdFrame:
        """A perfect image of camera `number`, with its true calibration; mask 1 where the object `of` is."""
        camera = self.cameras[number]
        columns, rows = np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
        x, y = (columns.ravel() - camera.cx_px) / camera.fx_px, (rows.ravel() - camera.cy_px) / camera.fy_px
        rays = np.column_stack([x, y, np.ones_like(x)]) @ camera.camera_to_world[:3, :3].T
        geoms, depth_m, normals = self._cast(camera.camera_to_world[:3, 3], rays)
        eye_m = camera.camera_to_world[:3, 3]
        rgb = self._shaded(layout, eye_m, eye_m + rays * depth_m[:, None], geoms, normals)
        hit = geoms >= 0
        bodies = np.where(hit, self._model.geom_bodyid[geoms], 0)
        mask = np.zeros(len(geoms), np.int32) if of is None else bodies == self._model.body("{} {}".format(*of)).id
        depth = np.where(hit, depth_m, 0).astype(np.float32)
        return RgbdFrame(
            camera,
            rgb.reshape(*SIZE_PX, 3),
            depth.reshape(SIZE_PX),
            mask.reshape(SIZE_PX).astype(np.int32),
        )

    def _cast(self, eye_m: Array, rays: Array) -> tuple[Array, Array, Array]:
        count = len(rays)
        geoms, depth_m, normals = np.full(count, -1, np.int32), np.zeros(count), np.zeros(3 * count)
        mujoco.mj_multiRay(
            self._model, self._data, eye_m.copy(), rays.ravel(), None, True, -1, geoms, depth_m, normals, count, RANGE_M
        )
        return geoms, depth_m, normals.reshape(-1, 3)

    def _shaded(self, layout: Layout, eye_m: Array, points_m: Array, geoms: Array, normals: Array) -> Array:
        direction, gain = layout.light
        to_light = -direction / np.linalg.norm(direction)
        light = (0.5 + 0.5 * np.clip(normals @ to_light, 0, None))[:, None] * gain
        rgb = np.where(geoms[:, None] >= 0, self._model.geom_rgba[geoms, :3] * light, ROOM)
        grain = 0.06 * np.sin(90 * points_m[:, :1] + 9 * np.sin(25 * points_m[:, 1:2]))  # the table's wood
        rgb = np.where((geoms == 0)[:, None], rgb * (1 + grain), rgb)
        if layout.has_gloss:
            to_eye = (eye_m - points_m) / np.linalg.norm(eye_m - points_m, axis=1, keepdims=True)
            middle = (to_light + to_eye) / np.linalg.norm(to_light + to_eye, axis=1, keepdims=True)
            mirrored = np.clip((normals * middle).sum(axis=1), 0, None) ** GLOSS_EXPONENT
            rgb = rgb + GLOSS * np.where(geoms > 0, mirrored, 0)[:, None] * gain
        return (rgb.clip(0, 1) * 255).astype(np.uint8)

    def _move(self, body: str, place_m: Array, rotation: Rotation) -> None:
        index = self._model.body(body).mocapid[0]
        self._data.mocap_pos[index], self._data.mocap_quat[index] = place_m, rotation.as_quat(scalar_first=True)

    def frames(
        self,
        layout: Layout,
        rng: np.random.Generator,
        *,
        noise: bool = True,
        of: tuple[str, int] | None = None,
        num: int = 3,
    ) -> tuple[RgbdFrame, ...]:
        """What the first `num` cameras give, calibrated with their errors unless without noise."""
        self.place(layout)
        shots = [self.shoot(layout, number, of) for number in range(num)]
        if not noise:
            return tuple(shots)
        return tuple(replace(as_d435(shot, rng), camera=self.calibrated[n]) for n, shot in enumerate(shots))


def _camera(name: str, azimuth_deg: float, elevation_deg: float, far_m: float) -> Camera:
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    eye = far_m * np.array(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    pose = camera_to_world(CameraPlacement(tuple(eye), (0, 0, 0), 43.6))
    return Camera(name, FOCAL_PX, FOCAL_PX, (WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2, pose)


def upright(x_m: float, y_m: float, yaw_rad: float) -> Array:
    """(4, 4) of something that stands on the table."""
    pose = np.eye(4)
    pose[:3, :3], pose[:2, 3] = about_z(yaw_rad).as_matrix(), (x_m, y_m)
    return pose


def sample(
    rng: np.random.Generator,
    targets: Sequence[tuple[str, int]],
    *,
    num_clutter: int = 0,
    light: bool = False,
    hide: bool = False,
) -> Layout:
    """Objects and clutter at random places that do not overlap.

    Args:
        hide: put something before each target, as the camera `front` sees it.
    """
    for _ in range(50):
        layout, taken = Layout(), list[tuple[Array, float]]()
        try:
            for name, number in sorted(targets, key=lambda item: -THINGS[item[0]].radius_m):
                place = _free_place(rng, taken, THINGS[name].radius_m)
                yaw = rng.uniform(-np.pi, np.pi) if name != "drawer" else rng.uniform(-0.5, 0.5)
                layout.poses[name, number] = upright(*place, yaw)
                if hide:
                    layout.clutter.append(_before(rng, len(layout.clutter), place, THINGS[name].radius_m, taken))
            while len(layout.clutter) < num_clutter + (len(targets) if hide else 0):
                half_m = rng.uniform(0.015, 0.045, 3)
                number = len(layout.clutter)
                place = _free_place(rng, taken, float(np.hypot(*half_m[:2])) if number % 2 else half_m[0])
                layout.clutter.append(_clutter(rng, number, half_m, place))
        except LookupError:
            continue
        if light:
            layout.light = _other_light(rng)
        return layout
    raise LookupError("no room")


def changed(layout: Layout, name: str, condition: str, rng: np.random.Generator) -> Layout:
    """The layout with another table, gloss, a cloth below the object `name`, or a box that touches it."""
    pose = layout.poses[name, 0]
    number = len(layout.clutter) | 1  # odd ones are boxes
    color = str(rng.choice(CLUTTER_COLORS))
    match condition:
        case "table":
            layout.table_rgb = tuple(rng.uniform(0.15, 0.95, 3).tolist())
        case "gloss":
            layout.has_gloss = True
        case "cloth":
            half_m = np.array([*(THINGS[name].radius_m + rng.uniform(0.01, 0.03, 2)), CLOTH_M / 2])
            layout.clutter.append((number, half_m, color, np.array([*pose[:2, 3], CLOTH_M / 2]), rng.uniform(0, 6)))
            pose[2, 3] += CLOTH_M
        case "touching":
            half_m, yaw = rng.uniform(0.02, 0.045, 3), float(rng.uniform(0, 2 * np.pi))
            away_m = THINGS[name].radius_m + half_m[0]
            place_m = pose[:2, 3] + away_m * np.array([np.cos(yaw), np.sin(yaw)])
            layout.clutter.append((number, half_m, color, np.array([*place_m, half_m[2]]), yaw))
    return layout


def _free_place(rng: np.random.Generator, taken: list[tuple[Array, float]], radius_m: float) -> Array:
    for _ in range(MAX_TRIALS):
        place = rng.uniform(-AREA_M, AREA_M)
        if all(np.hypot(*(place - other)) > radius_m + radius + GAP_M for other, radius in taken):
            taken.append((place, radius_m))
            return place
    raise LookupError


def _clutter(
    rng: np.random.Generator, number: int, half_m: Array, place: Array
) -> tuple[int, Array, str, Array, float]:
    height_m = half_m[2] if number % 2 else half_m[1]
    color = str(rng.choice(CLUTTER_COLORS))
    return number, half_m, color, np.array([*place, height_m]), float(rng.uniform(0, 6))


def _before(
    rng: np.random.Generator, number: int, place: Array, radius_m: float, taken: list[tuple[Array, float]]
) -> tuple[int, Array, str, Array, float]:
    """Something narrow on the way from the camera `front`, which stands at -y."""
    half_m = rng.uniform((0.015, 0.015, 0.03), (0.03, 0.03, 0.07))
    offset = np.array([rng.uniform(-0.6, 0.6) * radius_m, -(radius_m + half_m[:2].max() + rng.uniform(0.01, 0.03))])
    if any(np.hypot(*(place + offset - other)) < half_m[0] + radius for other, radius in taken[:-1]):
        raise LookupError
    taken.append((place + offset, float(np.hypot(*half_m[:2]))))
    return _clutter(rng, number, half_m, place + offset)


def _other_light(rng: np.random.Generator) -> tuple[Array, Array]:
    tint = rng.uniform(0.5, 1.2) * (1 + rng.uniform(-0.12, 0.12) * np.array([1, 0, -1]))
    angle, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 1.0)
    return np.array([np.cos(angle) * np.sin(tilt), np.sin(angle) * np.sin(tilt), -np.cos(tilt)]), tint
