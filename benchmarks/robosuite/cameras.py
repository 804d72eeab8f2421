"""Three depth cameras around robosuite's table: what they see of a scene, and which pixels show which object.

Rendered by OpenGL without a display, with robosuite's own textures, lights and shadows; `benchmarks.camera_noise` adds
what a depth camera does not measure exactly.
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

os.environ.setdefault("MUJOCO_GL", "egl")  # read when mujoco is imported

import mujoco
import numpy as np

from benchmarks.camera_noise import as_d435, miscalibrated
from benchmarks.robosuite.scene import Floats, Scene
from roboprompt_client.types.camera import Camera, RgbdFrame

WIDTH_PX, HEIGHT_PX = 640, 480
VERTICAL_FIELD_DEG = 45.0  # of MuJoCo's free camera
AZIMUTHS_DEG = {"front": 180.0, "left": 110.0, "right": -110.0}  # in which each looks
ELEVATION_DEG, DISTANCE_M = -50.0, 0.85
CALIBRATION_SEED = 7
VISUAL_GROUPS = (1, 2)  # robosuite's others are shapes for collisions
GHOST = "Visual"  # the beginning of the name of what only marks a place


def look(scene: Scene, bodies: Sequence[str], seed: int) -> tuple[RgbdFrame, ...]:
    """Return what the cameras see, with masks: 1 + the index in `bodies` of what a pixel shows, 0 for anything else.

    Args:
        seed: of the noise; errors of calibration are the same in every scene.
    """
    model, data, target_m = scene.model, scene.data, np.array(scene.task.looked_at_m)
    _hide_ghosts(model)
    ids = _mask_ids(model, bodies)
    frames = [_frame(model, data, name, azimuth, target_m, ids) for name, azimuth in AZIMUTHS_DEG.items()]
    fixed, noise = np.random.default_rng(CALIBRATION_SEED), np.random.default_rng(seed)
    return tuple(replace(as_d435(frame, noise), camera=miscalibrated(frame.camera, fixed)) for frame in frames)


def _frame(model: Any, data: Any, name: str, azimuth_deg: float, target_m: Floats, ids: Floats) -> RgbdFrame:  # noqa: ANN401
    renderer, view, options = _renderer(model), _view(azimuth_deg, target_m), mujoco.MjvOption()
    options.geomgroup[:] = 0
    options.geomgroup[list(VISUAL_GROUPS)] = 1
    options.sitegroup[:] = 0
    renderer.update_scene(data, view, options)
    rgb = renderer.render().copy()
    renderer.enable_depth_rendering()
    depth_m = renderer.render().copy()
    renderer.disable_depth_rendering()
    renderer.enable_segmentation_rendering()
    geoms, kinds = np.moveaxis(renderer.render(), 2, 0)
    renderer.disable_segmentation_rendering()
    mask = np.where(kinds == mujoco.mjtObj.mjOBJ_GEOM, ids[geoms], 0).astype(np.int32)
    return RgbdFrame(_camera(name, renderer), rgb, depth_m, mask)


def _view(azimuth_deg: float, target_m: Floats) -> Any:  # noqa: ANN401
    view = mujoco.MjvCamera()
    view.lookat[:], view.distance, view.azimuth, view.elevation = target_m, DISTANCE_M, azimuth_deg, ELEVATION_DEG
    return view


def _camera(name: str, renderer: Any) -> Camera:  # noqa: ANN401
    """Return the calibration of what was rendered last; MuJoCo's scene has two eyes at one place for one view."""
    eye = renderer.scene.camera[0]
    forward, up = np.array(eye.forward, np.float64), np.array(eye.up, np.float64)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(forward, up), -up, forward])
    pose[:3, 3] = (np.array(renderer.scene.camera[0].pos) + np.array(renderer.scene.camera[1].pos)) / 2
    focal_px = HEIGHT_PX / 2 / np.tan(np.radians(VERTICAL_FIELD_DEG) / 2)
    return Camera(name, focal_px, focal_px, (WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2, pose)


def _mask_ids(model: Any, bodies: Sequence[str]) -> Floats:  # noqa: ANN401
    """Return (geoms,) ids; a body's children belong to it."""
    owner = np.zeros(model.nbody, np.int64)
    for body in range(1, model.nbody):  # a parent comes before its children
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
        owner[body] = bodies.index(name) + 1 if name in bodies else owner[model.body_parentid[body]]
    return owner[model.geom_bodyid]


def _hide_ghosts(model: Any) -> None:  # noqa: ANN401
    for geom in range(model.ngeom):
        body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, model.geom_bodyid[geom]) or ""
        if body.startswith(GHOST):
            model.geom_rgba[geom, 3] = 0


@lru_cache(maxsize=1)
def _renderer(model: Any) -> Any:  # noqa: ANN401
    return mujoco.Renderer(model, HEIGHT_PX, WIDTH_PX)
