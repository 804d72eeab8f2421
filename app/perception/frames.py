"""A camera with its encoded images -> RgbdFrame."""

from dataclasses import dataclass

from app.perception.images import MAX_PIXELS, decode_depth, decode_mask, decode_rgb
from app.pipeline.camera import Camera, RgbdFrame


@dataclass(frozen=True)
class ImageBytes:
    """One camera's images as they were uploaded; None where there is none."""

    rgb: bytes | None = None
    depth: bytes | None = None
    mask: bytes | None = None


def decode_frame(camera: Camera, images: ImageBytes, max_pixels: int = MAX_PIXELS) -> RgbdFrame:
    """The camera's frame.

    Raises:
        InvalidInputError: naming the part (rgb_NAME, depth_NAME, mask_NAME) that is damaged or does not fit.
    """
    name = camera.name
    return RgbdFrame(
        camera,
        None if images.rgb is None else decode_rgb(f"rgb_{name}", images.rgb, max_pixels),
        None if images.depth is None else decode_depth(f"depth_{name}", images.depth, camera.depth_scale, max_pixels),
        None if images.mask is None else decode_mask(f"mask_{name}", images.mask, max_pixels),
    )
