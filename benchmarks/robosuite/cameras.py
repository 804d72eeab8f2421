"""Three depth cameras around a table of robosuite or LIBERO: what they see, and which pixels show which object.

Rendered by OpenGL with robosuite's own textures, lights and shadows, then with a D435's noise and miscalibrated.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import app.sim  # noqa: F401 - chooses OpenGL, which MuJoCo reads when it is imported

# isort: split
import mujoco
import numpy as np

from benchmarks.robosuite.arm import ControlledScene, Floats
from roboprompt_client.types.camera import Camera, RgbdFrame
from synthetic.camera_noise import as_d435, miscalibrated

WIDTH_PX, HEIGHT_PX = 640, 480
VERTICAL_FIELD_DEG = 45.0  # of MuJoCo's free camera
AZIMUTHS_DEG = {"front": 180.0, "left": 110.0, "right": -110.0}  # in which each looks, past the arm
ELEVATION_DEG, DISTANCE_M = -50.0, 0.85
CALIBRATION_SEED = 7
VISUAL_GROUPS = (1, 2)  # robosuite's others are shapes for collisions
GHOST = "Visual"  # the beginning of the name of what only marks a place


def look(
    scene: ControlledScene, looked_at_m: Sequence[float], bodies: Sequence[str], seed: int
) -> tuple[RgbdFrame, ...]:
    """Return what the cameras see, with masks: 1 + the index in `bodies` of what a pixel shows, 0 for anything else.

    Args:
        looked_at_m: (3,) a point of the table.
        seed: of the noise; errors of calibration are the same in every scene.
    """
    fixed, noise = np.random.default_rng(CALIBRATION_SEED), np.random.default_rng(seed)
    _hide_ghosts(scene.model)
    ids = mask_ids(scene.model, bodies)
    frames = []
    with mujoco.Renderer(scene.model, HEIGHT_PX, WIDTH_PX) as renderer:
        for name, azimuth_deg in AZIMUTHS_DEG.items():
            view = view_from(azimuth_deg, looked_at_m)
            frame = as_d435(_rendered(renderer, scene.data, camera_of(name, view), view, ids), noise)
            frames.append(replace(frame, camera=miscalibrated(frame.camera, fixed)))
    return tuple(frames)


def view_from(azimuth_deg: float, looked_at_m: Sequence[float]) -> Any:  # noqa: ANN401
    """Return MuJoCo's free camera that looks at a point (3,) in a direction."""
    view = mujoco.MjvCamera()
    view.lookat[:], view.distance, view.azimuth, view.elevation = looked_at_m, DISTANCE_M, azimuth_deg, ELEVATION_DEG
    return view


def camera_of(name: str, view: Any) -> Camera:  # noqa: ANN401
    """Return the calibration of a free camera of MuJoCo."""
    azimuth, elevation = np.radians([view.azimuth, view.elevation])
    across = np.cos(elevation)
    forward = np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)])
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = view.lookat - view.distance * forward
    focal_px = HEIGHT_PX / 2 / np.tan(np.radians(VERTICAL_FIELD_DEG) / 2)
    return Camera(name, focal_px, focal_px, (WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2, pose)


def mask_ids(model: Any, bodies: Sequence[str]) -> Floats:  # noqa: ANN401
    """Return the mask id (G,) of each geom of a model; what is mounted on a body belongs to it."""
    owners = np.zeros(model.nbody, np.int32)
    for body in range(1, model.nbody):  # a parent comes before its children
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
        owners[body] = bodies.index(name) + 1 if name in bodies else owners[model.body_parentid[body]]
    ids: Floats = owners[model.geom_bodyid]
    return ids


def _rendered(renderer: Any, data: Any, camera: Camera, view: Any, ids: Floats) -> RgbdFrame:  # noqa: ANN401
    options = mujoco.MjvOption()
    options.geomgroup[:] = 0
    options.geomgroup[list(VISUAL_GROUPS)] = 1
    options.sitegroup[:] = 0
    renderer.update_scene(data, view, options)
    rgb = renderer.render().copy()
    renderer.enable_depth_rendering()
    depth_m = renderer.render().copy()
    renderer.disable_depth_rendering()
    renderer.enable_segmentation_rendering()
    shown, kinds = np.moveaxis(renderer.render(), 2, 0)
    renderer.disable_segmentation_rendering()
    mask = np.where(kinds == mujoco.mjtObj.mjOBJ_GEOM, ids[shown], 0).astype(np.int32)
    return RgbdFrame(camera, rgb, depth_m, mask)


def _hide_ghosts(model: Any) -> None:  # noqa: ANN401
    for geom in range(model.ngeom):
        body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, model.geom_bodyid[geom]) or ""
        if body.startswith(GHOST):
            model.geom_rgba[geom, 3] = 0
