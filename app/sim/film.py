"""A film strip of a motion: one picture before it and one after each action."""

from contextlib import ExitStack
from types import TracebackType
from typing import Self

import mujoco

from app.sim.rendering import RgbImage, open_renderer

CAMERA = "front"


class FilmStrip:
    """Takes pictures of a scene within a `with` block; costs nothing where none are wanted.

    Args:
        model, data: the scene (mujoco.MjModel, mujoco.MjData).

    Attributes:
        images: (H, W, 3) of camera `front`, in order.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, *, wanted: bool) -> None:
        self._model, self._data, self._wanted = model, data, wanted
        self._resources = ExitStack()
        self.images: list[RgbImage] = []

    def __enter__(self) -> Self:
        if self._wanted:
            self._renderer = self._resources.enter_context(open_renderer(self._model))
        self.shoot()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._resources.close()

    def shoot(self) -> None:
        """Take a picture now."""
        if self._wanted:
            self.images.append(self._renderer.rgb(self._data, CAMERA))
