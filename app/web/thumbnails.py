"""Small pictures for lists."""

import cv2

from app.perception.images import decode_rgb
from app.store.blobs import BlobStore
from app.store.values import CameraRecord

WIDTH_PX = 192  # twice what lists show, for dense screens
JPEG_QUALITY = 80


def thumbnail(blobs: BlobStore, camera: CameraRecord) -> bytes | None:
    """A JPEG of the camera's colour image; None if it has none.

    Raises:
        CorruptDataError, StoreUnavailableError: if the image cannot be read.
    """
    if camera.rgb_digest is None:
        return None
    rgb = decode_rgb(f"rgb_{camera.name}", blobs.read(camera.rgb_digest))
    height, width = rgb.shape[:2]
    size = (WIDTH_PX, max(1, round(height * WIDTH_PX / width)))
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small[..., ::-1], (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))[1].tobytes()


def pictured(cameras: tuple[CameraRecord, ...]) -> str | None:
    """The name of the first camera with a colour image."""
    return next((camera.name for camera in cameras if camera.rgb_digest is not None), None)
