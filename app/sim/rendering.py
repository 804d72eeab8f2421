"""Pictures of a scene: by OpenGL where there is one, otherwise by casting rays; only the shading differs."""

import functools
import logging
import os
from types import TracebackType
from typing import Protocol, Self

import mujoco
import numpy as np
import numpy.typing as npt

from app.pipeline.camera import RgbdFrame
from app.sim.cameras import HEIGHT_PX, WIDTH_PX, calibrated
from app.sim.opengl import NO_OPENGL
from app.sim.raycast import RayCaster

logger = logging.getLogger(__name__)

RgbImage = npt.NDArray[np.uint8]


class SceneRenderer(Protocol):
    """Renders the state of one model's data at 640x480 (W x H)."""

    def rgb(self, data: mujoco.MjData, camera_name: str) -> RgbImage:
        """(H, W, 3)."""
        ...

    def rgbd(self, data: mujoco.MjData, camera_name: str) -> RgbdFrame:
        """Colours, depth along the optical axis in m (0: nothing) and MuJoCo body ids (0: scenery or nothing)."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...


class OpenGLRenderer:
    """By MuJoCo's own renderer. Holds an OpenGL context of the calling thread until it is left."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._body_of_geom = np.append(model.geom_bodyid, 0)  # index -1, no geom, reads the last element
        self._renderer = mujoco.Renderer(model, HEIGHT_PX, WIDTH_PX)

    def rgb(self, data: mujoco.MjData, camera_name: str) -> RgbImage:
        self._renderer.update_scene(data, camera_name)
        image: RgbImage = self._renderer.render()
        return image

    def rgbd(self, data: mujoco.MjData, camera_name: str) -> RgbdFrame:
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._renderer.close()


def open_renderer(model: mujoco.MjModel) -> SceneRenderer:
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
