"""Cameras and image parts of a request -> calibrated frames. Synchronous: call it with `decoded`."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import ParamSpec, TypeVar

import anyio.to_thread

from app.api.body import IMAGE_PREFIXES
from app.api.schemas.requests import CameraIn
from app.perception.images import ImageBytes, decode_frame
from app.services.container import Services
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import RgbdFrame

P = ParamSpec("P")
T = TypeVar("T")


async def decoded(services: Services, func: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """What `func`, which decodes images, returns; called in a thread, of which few do so at once."""
    return await anyio.to_thread.run_sync(partial(func, *args, **kwargs), limiter=services.decoding)


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


def decode_frames(cameras: Sequence[CameraIn], images: Mapping[str, ImageBytes]) -> tuple[RgbdFrame, ...]:
    """The frames of all cameras, in their order.

    Raises:
        InvalidInputError: naming the image part or the camera's field.
    """
    return tuple(decode_frame(camera.camera(), images[camera.name]) for camera in cameras)
