"""Bounds on requests with images: pixels in memory, decoders at once, and no work for clients that have left.

A thread cannot be ended from outside. What it does is bounded beforehand (`app.perception.images`, `Limits`), and
between two images it checks that the client still waits. Cameras and image parts become RgbdFrames.
"""

import asyncio
import os
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from functools import partial
from typing import ParamSpec, Protocol, TypeVar

import anyio
import anyio.from_thread
import anyio.to_thread
from fastapi import Request
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from app.api.body import IMAGE_PREFIXES, Body
from app.api.schemas.requests import CameraIn
from app.perception.images import ImageBytes, decode_frame, num_pixels
from app.services.limits import Limits
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import RgbdFrame

MAX_WAIT_S = 20.0  # for room, for a decoder, and for its work, each
REQUESTS_IN_MEMORY = 2  # of the largest that are allowed, or more of smaller ones
P = ParamSpec("P")
T = TypeVar("T")


class Decode(Protocol):
    """Runs a function that decodes images in a thread."""

    def __call__(self, func: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Awaitable[T]: ...


class ImageWork:
    """The room of one process."""

    def __init__(self) -> None:
        self._decoders = anyio.CapacityLimiter(max(2, os.cpu_count() or 1))
        self._pixels = _Room()

    @asynccontextmanager
    async def room(self, request: Request, body: Body, limits: Limits) -> AsyncIterator[Decode]:
        """Room for the body's images while they and what is made of them are in memory; at once if there are none.

        Raises:
            InvalidInputError: if they have too many pixels together.
            HTTPException: 503 if there is no room for long.
            ClientDisconnect: if the client leaves.
        """
        if not (images := [data for name, data in body.parts.items() if name.startswith(IMAGE_PREFIXES)]):
            yield run_in_threadpool
            return
        pixels = sum(map(num_pixels, images))
        limits.check_pixels(pixels)
        place = partial(self._pixels.take, pixels, REQUESTS_IN_MEMORY * limits.max_request_pixels)
        await _while_wanted(request, place)
        try:
            yield partial(self.run, request)
        finally:
            self._pixels.give_back(pixels)

    async def run(self, request: Request, func: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """What the function returns, called in a thread for which a decoder's place was free.

        Raises:
            as `room`, and what the function raises.
        """
        call = partial(func, *args, **kwargs)
        return await _while_wanted(request, partial(anyio.to_thread.run_sync, call, limiter=self._decoders))


def image_work(request: Request) -> ImageWork:
    """That of the request's application."""
    work: ImageWork = request.app.state.image_work
    return work


async def _while_wanted(request: Request, call: Callable[[], Awaitable[T]]) -> T:
    left = False

    async def watch() -> None:
        nonlocal left
        while (await request.receive())["type"] != "http.disconnect":
            pass
        left = True
        scope.cancel()

    with anyio.move_on_after(MAX_WAIT_S) as scope:
        watching = asyncio.create_task(watch())
        try:
            return await call()
        finally:
            watching.cancel()
    if left:
        raise ClientDisconnect
    raise HTTPException(503, f"images were not decoded within {MAX_WAIT_S:g} s: try again", {"Retry-After": "5"})


class _Room:
    """A number of pixels that requests share, in the order in which they ask."""

    def __init__(self) -> None:
        self._used = 0
        self._turn = asyncio.Lock()  # is acquired in the order of asking, so that large requests are not overtaken
        self._freed = asyncio.Event()

    async def take(self, amount: int, of: int) -> None:
        """Wait until `amount` of `of` is free, and take it."""
        async with self._turn:
            while self._used + amount > of:
                self._freed.clear()
                await self._freed.wait()
            self._used += amount

    def give_back(self, amount: int) -> None:
        """Let others have it."""
        self._used -= amount
        self._freed.set()


def split_images(cameras: Sequence[CameraIn], parts: Mapping[str, bytes]) -> dict[str, ImageBytes]:
    """The image parts by camera.

    Raises:
        InvalidInputError: for a part that is no image, or belongs to no camera; for a camera named twice.
    """
    names = [camera.name for camera in cameras]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInputError("cameras", f"{twice[0]!r} appears twice", "each camera once")
    for part in parts:
        if not part.startswith(IMAGE_PREFIXES):
            raise InvalidInputError(part, "is not a part of this request", "metadata, rgb_NAME, depth_NAME, mask_NAME")
        if (camera := part.partition("_")[2]) not in names:
            known = ", ".join(names) or "none: add it to metadata.cameras"
            raise InvalidInputError(part, f"there is no camera {camera!r} in metadata.cameras", known)
    return {name: ImageBytes(*(parts.get(f"{prefix}{name}") for prefix in IMAGE_PREFIXES)) for name in names}


def decode_frames(
    cameras: Sequence[CameraIn], images: Mapping[str, ImageBytes], max_pixels: int
) -> tuple[RgbdFrame, ...]:
    """The frames of all cameras, in their order.

    Raises:
        InvalidInputError: naming the image part or the camera's field.
    """
    frames = []
    for camera in cameras:
        with suppress(RuntimeError):  # no thread of `ImageWork.run`, whose work ends here if its client has left
            anyio.from_thread.check_cancelled()
        frames.append(decode_frame(camera.camera(), images[camera.name], max_pixels))
    return tuple(frames)
