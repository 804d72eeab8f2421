"""Cameras and image parts -> RgbdFrames."""

from collections.abc import Mapping, Sequence

from app.api.body import IMAGE_PREFIXES
from app.api.image_work import stop_if_unwanted
from app.api.schemas.requests import CameraIn
from app.perception.images import ImageBytes, decode_frame
from app.pipeline.camera import RgbdFrame
from app.pipeline.errors import InvalidInputError


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
    return tuple(_decoded(item, images[item.name], max_pixels) for item in cameras)


def _decoded(camera: CameraIn, images: ImageBytes, max_pixels: int) -> RgbdFrame:
    stop_if_unwanted()
    return decode_frame(camera.camera(), images, max_pixels)
