"""A scene's images: to the store as they came, and back as frames."""

from collections.abc import Iterable, Mapping

from app.perception.frames import ImageBytes, decode_frame
from app.perception.images import STORED_PIXELS
from app.pipeline.camera import Camera, RgbdFrame
from app.store.blobs import BlobStore
from app.store.values import CameraRecord


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
        records.append(CameraRecord.of(camera, *digests))
    return tuple(records)


def read_frame(blobs: BlobStore, record: CameraRecord) -> RgbdFrame:
    """The camera's frame, decoded again.

    Raises:
        CorruptDataError, StoreUnavailableError: if its images cannot be read.
    """
    digests = (record.rgb_digest, record.depth_digest, record.mask_digest)
    images = ImageBytes(*(None if digest is None else blobs.read(digest) for digest in digests))
    return decode_frame(record.camera(), images, STORED_PIXELS)
