"""Colour, depth and body ids of a scene without OpenGL: one ray a pixel."""

from types import TracebackType
from typing import Self

import mujoco
import numpy as np
import numpy.typing as npt

from app.pipeline.arrays import Array
from app.pipeline.camera import Camera, RgbdFrame
from app.sim.cameras import HEIGHT_PX, WIDTH_PX, calibrated
from app.sim.world import MAIN_LIGHT_DIRECTION, SKY_RGB

RANGE_M = 10.0
TO_LIGHT = -np.array(MAIN_LIGHT_DIRECTION) / np.linalg.norm(MAIN_LIGHT_DIRECTION)
AMBIENT, DIFFUSE = 0.5, 0.6


class RayCaster:
    """Same results as `app.sim.rendering.OpenGLRenderer`, shaded without shadows; needs no context."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model

    def rgb(self, data: mujoco.MjData, camera_name: str) -> npt.NDArray[np.uint8]:
        geoms, _, normals = self._cast(data, calibrated(camera_name))
        return self._shade(geoms, normals)

    def rgbd(self, data: mujoco.MjData, camera_name: str) -> RgbdFrame:
        camera = calibrated(camera_name)
        geoms, depth_m, normals = self._cast(data, camera)
        hit = geoms >= 0
        mask = np.where(hit, self._model.geom_bodyid[geoms], 0).astype(np.int32)
        depth = np.where(hit, depth_m, 0).astype(np.float32)
        size = (HEIGHT_PX, WIDTH_PX)
        return RgbdFrame(camera, self._shade(geoms, normals), depth.reshape(size), mask.reshape(size))

    def _shade(self, geoms: npt.NDArray[np.int32], normals: Array) -> npt.NDArray[np.uint8]:
        light = AMBIENT + DIFFUSE * np.clip(normals @ TO_LIGHT, 0, None)
        lit = self._model.geom_rgba[geoms, :3] * light[:, None]
        colours = np.where(geoms[:, None] >= 0, lit, SKY_RGB)
        return (colours.clip(0, 1) * 255).astype(np.uint8).reshape(HEIGHT_PX, WIDTH_PX, 3)

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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Nothing to release."""


def _rays(camera: Camera) -> Array:
    """(H * W, 3) world directions through the pixels, 1 m long along the optical axis: distances are then depths."""
    columns, rows = np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
    x = (columns.ravel() - camera.cx_px) / camera.fx_px
    y = (rows.ravel() - camera.cy_px) / camera.fy_px
    rays: Array = np.stack([x, y, np.ones_like(x)], axis=1) @ camera.camera_to_world[:3, :3].T
    return rays
