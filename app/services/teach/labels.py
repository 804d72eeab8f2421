"""Labels of objects by a person (clicks, boxes, polygons, masks) -> masks in the cameras' images."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.images import ImageBytes
from app.perception.registered.marks import Marks, Mask, Pixel, masks_from_marks, yaw_of_arrow_deg
from app.perception.registered.scene import Scene
from app.services.cache import Cache
from app.services.images import put_images, read_frame
from app.store import episodes, labels, tasks
from app.store.labels import LabelRecord
from app.store.store import Store
from app.store.values import CameraRecord
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import RgbdFrame

MAX_LABELS = 100  # of a task
MAX_VIEWS_KEPT = 2  # decoded, for the next click on the same pictures


@dataclass(frozen=True, eq=False)
class LabelDraft:
    """The place of an object in images.

    Attributes:
        episode_id: whose images they are; None for those of `frames`.
        frames: images of their own; with `masks` of an episode only the masks count.
        images: of `frames` as they came, by camera.
        masks: decoded mask images, by camera.
        mask_ids: the ids of the object in mask images; without any, all that is not 0 in `masks`.
        polygons: corners (x, y) by camera.
        arrows: pixels (tail, head) by camera of an arrow along the object's x axis.
    """

    task: str
    object: str
    episode_id: str | None
    frames: tuple[RgbdFrame, ...]
    images: Mapping[str, ImageBytes]
    masks: Mapping[str, npt.NDArray[np.int32]]
    mask_ids: tuple[int, ...]
    polygons: Mapping[str, Sequence[Pixel]]
    marks: Marks
    arrows: Mapping[str, tuple[Pixel, Pixel]]
    yaw_deg: float | None


@dataclass(frozen=True, eq=False)
class LabeledImages:
    """The images of a label.

    Attributes:
        given_ids: by object the ids that its pixels have in the episode's mask images.
    """

    cameras: tuple[CameraRecord, ...]
    frames: tuple[RgbdFrame, ...]
    given_ids: Mapping[str, tuple[int, ...]]


class LabelObjects:
    """Previews and stores labels. Synchronous: call it in a thread."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._frames: Cache[str, tuple[RgbdFrame, ...]] = Cache(MAX_VIEWS_KEPT)
        self._scenes: Cache[str, Scene] = Cache(MAX_VIEWS_KEPT)

    def preview(self, draft: LabelDraft) -> tuple[Mapping[str, Mask], float | None]:
        """Return the mask by camera, and the yaw, that the label would have; nothing is stored. Raises as the call."""
        view = self._view(draft, store_images=False)
        return self._masks(draft, view), _yaw_deg(draft, view)

    def __call__(self, draft: LabelDraft) -> LabelRecord:
        """Store where the object is in each camera's image.

        Raises:
            NotFoundError: if there is no such task or episode.
            InvalidInputError: if no mask follows from the draft, the images are unusable, or there are too many labels.
        """
        view = self._view(draft, store_images=True)
        masks, yaw = self._masks(draft, view), _yaw_deg(draft, view)
        digests = {name: self._store.blobs.put(_png(mask)) for name, mask in masks.items() if mask.any()}
        labeled = tuple(replace(camera, mask_digest=digests.get(camera.name)) for camera in view.cameras)
        counts = {name: int(mask.sum()) for name, mask in masks.items()}
        with self._store.write() as connection:
            if labels.number_of(connection, draft.task) >= MAX_LABELS:
                raise InvalidInputError("task", f"has {MAX_LABELS} labels", "fewer: delete those that did not merge")
            record = LabelRecord(draft.task, draft.object, labeled, counts, yaw, draft.episode_id)
            return labels.add(connection, record)

    def _view(self, draft: LabelDraft, *, store_images: bool) -> LabeledImages:
        """The images of a draft.

        Args:
            store_images: those of its own; an episode's are stored already.

        Raises:
            NotFoundError: if there is no such task or episode.
            InvalidInputError: if the task has no such object, or no camera has color and depth.
        """
        with self._store.read() as connection:
            task = tasks.get(connection, draft.task)
            record = None if draft.episode_id is None else episodes.get(connection, draft.episode_id)
        if task.object_names is not None and draft.object not in task.object_names:
            raise InvalidInputError(
                "object", f"{draft.object!r} is no object of the task", ", ".join(task.object_names)
            )
        if record is None:
            calibrated = [frame.camera for frame in draft.frames]
            images = draft.images if store_images else dict.fromkeys(draft.images, ImageBytes())
            return LabeledImages(put_images(self._store.blobs, calibrated, images), draft.frames, {})
        if record.task != draft.task:
            raise InvalidInputError("episode_id", f"is of the task {record.task!r}", f"an episode of {draft.task!r}")
        cameras = tuple(item for item in record.cameras if item.has_rgbd)
        if not cameras:
            raise InvalidInputError("episode_id", "has no camera with color and depth", "an episode with RGB-D images")
        blobs = self._store.blobs
        frames = self._frames.get_or_make(_key(cameras), lambda: tuple(read_frame(blobs, item) for item in cameras))
        ids = {item["name"]: tuple(item["mask_ids"]) for item in record.given_objects}
        return LabeledImages(cameras, frames, ids)

    def _masks(self, draft: LabelDraft, view: LabeledImages) -> dict[str, Mask]:
        """By camera where the object is: of marks in all cameras, else as each camera says.

        Raises:
            InvalidInputError: if no mask follows from the draft.
        """
        names = [frame.camera.name for frame in view.frames]
        marks = draft.marks
        said = {"clicks": marks.clicks, "clicks_off": marks.clicks_off, "boxes": marks.boxes, "arrows": draft.arrows}
        for field, item in {**said, "polygons": draft.polygons, "mask": draft.masks}.items():
            for name in item:
                if name not in names:
                    raise InvalidInputError(
                        f"{field}[{name}]", "is of no camera with color and depth", ", ".join(names)
                    )
        masks: dict[str, Mask] = {}
        if marks:
            masks = masks_from_marks(self._scene(draft, view), view.frames, marks)
        for frame in view.frames:
            if (mask := _said_of(draft, view, frame)) is not None:
                masks[frame.camera.name] = mask
        if not any(mask.any() for mask in masks.values()):
            message = f"{draft.object!r} is in no mask of {', '.join(masks) or 'any camera'}"
            raise InvalidInputError("object", message, "clicks, boxes, polygons, mask_ids or mask_NAME")
        return masks

    def _scene(self, draft: LabelDraft, view: LabeledImages) -> Scene:
        if draft.episode_id is None:
            return Scene.of(view.frames)
        return self._scenes.get_or_make(_key(view.cameras), lambda: Scene.of(view.frames))


def _png(mask: Mask) -> bytes:
    return cv2.imencode(".png", mask.astype(np.uint8))[1].tobytes()


def _yaw_deg(draft: LabelDraft, view: LabeledImages) -> float | None:
    """Of the object's x axis about the vertical, as said or drawn.

    Raises:
        InvalidInputError: if there are several, or the arrow says none.
    """
    if len(draft.arrows) + (draft.yaw_deg is not None) > 1:
        raise InvalidInputError("arrows", "say the yaw more than once", "yaw_deg, or one arrow in one camera")
    for frame in view.frames:
        if (arrow := draft.arrows.get(frame.camera.name)) is not None:
            return round(yaw_of_arrow_deg(frame, *arrow), 1)
    return draft.yaw_deg


def _key(cameras: Sequence[CameraRecord]) -> str:
    return json.dumps([camera.to_json() for camera in cameras])


def _said_of(draft: LabelDraft, view: LabeledImages, frame: RgbdFrame) -> Mask | None:
    """The mask that a polygon or mask image of the camera gives."""
    name = frame.camera.name
    assert frame.depth_m is not None
    if name in draft.polygons:
        return _filled(name, draft.polygons[name], frame.depth_m.shape)
    if name in draft.masks:
        mask = draft.masks[name]
        if mask.shape != frame.depth_m.shape:
            size = f"{frame.depth_m.shape[1]}x{frame.depth_m.shape[0]}"
            raise InvalidInputError(f"mask_{name}", f"is {mask.shape[1]}x{mask.shape[0]}", f"{size}, as the image")
        return np.isin(mask, draft.mask_ids) if draft.mask_ids else mask != 0
    ids = draft.mask_ids or view.given_ids.get(draft.object, ())
    if draft.marks or draft.episode_id is None or frame.mask is None or not ids:
        return None
    return np.isin(frame.mask, ids)


def _filled(name: str, corners: Sequence[Pixel], shape: tuple[int, ...]) -> Mask:
    if len(corners) < 3:
        raise InvalidInputError(f"polygons[{name}]", f"has {len(corners)} corners", "three or more (x, y)")
    mask = np.zeros(shape, np.uint8)
    cv2.fillPoly(mask, [np.rint(np.clip(corners, -10_000, 10_000)).astype(np.int32)], 1)
    return mask > 0
