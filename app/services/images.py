"""Images of episodes and predictions: stored as they came, and read again as frames."""

from collections.abc import Iterable, Mapping
from functools import partial

import numpy as np
import numpy.typing as npt

from app.perception.frame_checks import are_swapped
from app.perception.images import ImageBytes, decode_frame, decode_rgb
from app.services.cache import Cache
from app.store.blobs import BlobStore
from app.store.errors import NotFoundError
from app.store.values import CameraRecord, ImageKind
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame, camera_json

MAX_COLORS, MEAN_STEP_PX = 256, 4
_mean_rgb: Cache[str, Array] = Cache(MAX_COLORS)


def put_images(
    blobs: BlobStore, cameras: Iterable[Camera], images: Mapping[str, ImageBytes]
) -> tuple[CameraRecord, ...]:
    """Store the images; returns the cameras with their digests, for the row that refers to them.

    Args:
        images: of each camera, by its name.
    """
    records = []
    for camera in cameras:
        sent = images[camera.name]
        digests = [None if data is None else blobs.put(data) for data in (sent.rgb, sent.depth, sent.mask)]
        records.append(CameraRecord(camera_json(camera), *digests))
    return tuple(records)


def stored_image(cameras: Iterable[CameraRecord], name: str, kind: ImageKind, where: str) -> tuple[CameraRecord, str]:
    """The camera of that name, and the digest of its image of that kind.

    Args:
        where: what they are of, in words.

    Raises:
        NotFoundError: if there is no such camera or image.
    """
    for record in cameras:
        if record.name == name and (digest := record.digest(kind)) is not None:
            return record, digest
    raise NotFoundError(f"{kind} image of {where}", name)


def read_frame(blobs: BlobStore, record: CameraRecord) -> RgbdFrame:
    """The camera's frame, decoded again.

    Raises:
        CorruptDataError, StoreUnavailableError: if its images cannot be read.
    """
    digests = (record.rgb_digest, record.depth_digest, record.mask_digest)
    images = ImageBytes(*(None if digest is None else blobs.read(digest) for digest in digests))
    return decode_frame(record.camera(), images)


def check_colors(blobs: BlobStore, usual: Iterable[CameraRecord], frames: Iterable[RgbdFrame]) -> None:
    """Refuse color images that have red and blue exchanged, by the images that the same cameras took before.

    Raises:
        InvalidInputError: naming rgb_NAME.
        CorruptDataError, StoreUnavailableError: if a stored image cannot be read.
    """
    digests = {record.name: record.rgb_digest for record in usual}
    for frame in frames:
        field, digest = f"rgb_{frame.camera.name}", digests.get(frame.camera.name)
        if digest is None or frame.rgb is None:
            continue
        if are_swapped(_mean_rgb.get_or_make(digest, partial(_stored_mean, blobs, digest)), _mean(frame.rgb)):
            message = "looks like the newest episode's image with red and blue exchanged: BGR instead of RGB?"
            valid = "RGB, as in that episode; poses instead of images, if the surroundings have these colors now"
            raise InvalidInputError(field, message, valid)


def _stored_mean(blobs: BlobStore, digest: str) -> Array:
    return _mean(decode_rgb("rgb", blobs.read(digest)))


def _mean(rgb: npt.NDArray[np.uint8]) -> Array:
    """Return the mean color (3,) of an image (H, W, 3)."""
    mean: Array = rgb[::MEAN_STEP_PX, ::MEAN_STEP_PX].mean(axis=(0, 1))
    return mean
