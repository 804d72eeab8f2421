"""Pictures of a scene: by OpenGL where there is one, otherwise by casting rays; only the shading differs.

Rays, one a pixel, also give depth and body ids.
"""

import functools
import logging
import os
from typing import Self

import mujoco
import numpy as np
import numpy.typing as npt

from app.sim import NO_OPENGL
from app.sim.world import HEIGHT_PX, MAIN_LIGHT_DIRECTION, SKY_RGB, WIDTH_PX, calibrated
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame

RgbImage = npt.NDArray[np.uint8]
RANGE_M = 10.0
TO_LIGHT = -np.array(MAIN_LIGHT_DIRECTION) / np.linalg.norm(MAIN_LIGHT_DIRECTION)
AMBIENT, DIFFUSE = 0.5, 0.6
logger = logging.getLogger(__name__)


class RayCaster:
    """Renders a model's data at 640x480 (W x H) as OpenGLRenderer does, but for shadows; needs no context."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model

    def rgb(self, data: mujoco.MjData, camera_name: str) -> RgbImage:
        """(H, W, 3)."""
        geoms, _, normals = self._cast(data, calibrated(camera_name))
        return self._shade(geoms, normals)

    def rgbd(self, data: mujoco.MjData, camera_name: str) -> RgbdFrame:
        """Colors, depth along the optical axis in m (0: nothing) and MuJoCo body ids (0: scenery or nothing)."""
        return self.frame(data, calibrated(camera_name))

    def frame(self, data: mujoco.MjData, camera: Camera) -> RgbdFrame:
        """As `rgbd`, of any camera of 640x480 pixels."""
        geoms, depth_m, normals = self._cast(data, camera)
        hit = geoms >= 0
        mask = np.where(hit, self._model.geom_bodyid[geoms], 0).astype(np.int32)
        depth = np.where(hit, depth_m, 0).astype(np.float32)
        size = (HEIGHT_PX, WIDTH_PX)
        return RgbdFrame(camera, self._shade(geoms, normals), depth.reshape(size), mask.reshape(size))

    def _shade(self, geoms: npt.NDArray[np.int32], normals: Array) -> RgbImage:
        light = AMBIENT + DIFFUSE * np.clip(normals @ TO_LIGHT, 0, None)
        lit = self._model.geom_rgba[geoms, :3] * light[:, None]
        colors = np.where(geoms[:, None] >= 0, lit, SKY_RGB)
        return (colors.clip(0, 1) * 255).astype(np.uint8).reshape(HEIGHT_PX, WIDTH_PX, 3)

    def _cast(self, data: mujoco.MjData, camera: Camera) -> tuple[npt.NDArray[np.int32], Array, Array]:
        """Per pixel, row by row: the geom that it shows (-1: none), the depth in m and the surface's normal (N, 3)."""
        rays = _rays(camera)
        count = len(rays)
        geoms, distances, normals = np.full(count, -1, np.int32), np.zeros(count), np.zeros(3 * count)
        position = camera.camera_to_world[:3, 3].copy()
        mujoco.mj_multiRay(
            self._model, data, position, rays.ravel(), None, True, -1, geoms, distances, normals, count, RANGE_M
        )
        return geoms, distances, normals.reshape(-1, 3)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to release."""


def _rays(camera: Camera) -> Array:
    """(H * W, 3) world directions through the pixels, 1 m long along the optical axis: distances are then depths."""
    columns, rows = np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
    x = (columns.ravel() - camera.cx_px) / camera.fx_px
    y = (rows.ravel() - camera.cy_px) / camera.fy_px
    rays: Array = np.stack([x, y, np.ones_like(x)], axis=1) @ camera.camera_to_world[:3, :3].T
    return rays


class OpenGLRenderer:
    """By MuJoCo's own renderer. Holds an OpenGL context of the calling thread until it is left."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._body_of_geom = np.append(model.geom_bodyid, 0)  # index -1, no geom, reads the last element
        self._renderer = mujoco.Renderer(model, HEIGHT_PX, WIDTH_PX)

    def rgb(self, data: mujoco.MjData, camera_name: str) -> RgbImage:
        """(H, W, 3)."""
        self._renderer.update_scene(data, camera_name)
        image: RgbImage = self._renderer.render()
        return image

    def rgbd(self, data: mujoco.MjData, camera_name: str) -> RgbdFrame:
        """Return the same as `RayCaster.rgbd`."""
        rgb = self.rgb(data, camera_name)
        self._renderer.enable_depth_rendering()
        depth_m = self._renderer.render()
        self._renderer.enable_segmentation_rendering()
        geoms = self._renderer.render()[..., 0]
        self._renderer.disable_segmentation_rendering()
        mask = self._body_of_geom[geoms].astype(np.int32)
        return RgbdFrame(calibrated(camera_name), rgb, np.where(geoms < 0, np.float32(0), depth_m), mask)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()


def open_renderer(model: mujoco.MjModel) -> OpenGLRenderer | RayCaster:
    """The best renderer that works here; use it in a `with` block."""
    return OpenGLRenderer(model) if opengl_works() else RayCaster(model)


def opengl_works() -> bool:
    """Whether OpenGL can render in this process; a failure is logged with its cause."""
    process_id = _opengl_process()
    if process_id is not None and process_id != os.getpid():
        logger.warning("a process that used OpenGL was forked, casting rays: start workers with 'spawn' instead")
        return False
    return process_id is not None


@functools.cache
def _opengl_process() -> int | None:
    """The process in which OpenGL was found to work; a fork of it inherits the answer, but its OpenGL would hang."""
    backend = os.environ.get("MUJOCO_GL", "")
    if backend == NO_OPENGL:
        logger.warning("no OpenGL (install libegl1 and libgl1, or libosmesa6): casting rays, several times slower")
        return None
    try:
        mujoco.Renderer(mujoco.MjSpec().compile(), 8, 8).close()
    except Exception as error:  # depends on backend and driver: ImportError, RuntimeError, mujoco.FatalError, GLError
        message = "OpenGL cannot render, casting rays, several times slower (MUJOCO_GL=%r when MuJoCo was imported): %s"
        logger.warning(message, backend, error)
        return None
    return os.getpid()
