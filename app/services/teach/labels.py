"""Labelled views of objects: taken in, and learned from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.images import ImageBytes
from app.perception.object_model import ObjectModelError
from app.perception.registered.click import masks_from_clicks
from app.perception.registered.learn import LabelledView, Learned, learn
from app.perception.registered.model import LeftOutView, RegisteredModel, yaw_symmetry_deg
from app.services.scene_images import put_images, read_frame
from app.services.teach.configure import ConfigureTask
from app.store import episodes, labels, tasks
from app.store.labels import LabelRecord
from app.store.store import Store
from app.store.values import CameraRecord
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.errors import InvalidInputError

MAX_LABELS = 100  # of a task
MAX_VIEWS = 10  # that an object is learned from
Mask = npt.NDArray[np.bool_]
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class LabelDraft:
    """Where an object is in images.

    Attributes:
        episode_id: whose images they are; None for those of `frames`.
        frames: images of their own; with `masks` of an episode only the masks count.
        images: of `frames` as they came, by camera.
        masks: decoded mask images, by camera.
        mask_ids: the ids of the object in mask images; without any, all that is not 0 in `masks`.
        polygons: corners (x, y) by camera.
        clicks: a pixel (x, y) by camera.
    """

    task: str
    object: str
    episode_id: str | None
    frames: tuple[RgbdFrame, ...]
    images: Mapping[str, ImageBytes]
    masks: Mapping[str, npt.NDArray[np.int32]]
    mask_ids: tuple[int, ...]
    polygons: Mapping[str, Sequence[Point]]
    clicks: Mapping[str, Point]
    yaw_deg: float | None


class LabelObjects:
    """Stores labels. Synchronous: call it in a thread."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def __call__(self, draft: LabelDraft) -> LabelRecord:
        """Store where the object is in each camera's image.

        Raises:
            NotFoundError: if there is no such task or episode.
            InvalidInputError: if no mask follows from the draft, the images are unusable, or there are too many labels.
        """
        cameras, frames = self._images(draft)
        masks = _masks(draft, frames)
        labelled = []
        for camera in cameras:
            if (mask := masks.get(camera.name)) is not None and mask.any():
                digest = self._store.blobs.put(_png(mask))
                labelled.append(replace(camera, mask_digest=digest))
            else:
                labelled.append(replace(camera, mask_digest=None))
        counts = {name: int(mask.sum()) for name, mask in masks.items()}
        if not any(counts.values()):
            message = f"{draft.object!r} is in no mask of {', '.join(counts) or 'any camera'}"
            raise InvalidInputError("object", message, "clicks, polygons, mask_ids or mask_NAME")
        with self._store.write() as connection:
            if labels.number_of(connection, draft.task) >= MAX_LABELS:
                raise InvalidInputError("task", f"has {MAX_LABELS} labels", "fewer: delete those that did not merge")
            return labels.add(
                connection, draft.task, draft.object, tuple(labelled), counts, draft.yaw_deg, draft.episode_id
            )

    def _images(self, draft: LabelDraft) -> tuple[tuple[CameraRecord, ...], tuple[RgbdFrame, ...]]:
        """The cameras with their stored images, and these decoded."""
        with self._store.read() as connection:
            task = tasks.get(connection, draft.task)
            record = None if draft.episode_id is None else episodes.get(connection, draft.episode_id)
        if task.object_names is not None and draft.object not in task.object_names:
            raise InvalidInputError(
                "object", f"{draft.object!r} is no object of the task", ", ".join(task.object_names)
            )
        if record is None:
            calibrated = [frame.camera for frame in draft.frames]
            return put_images(self._store.blobs, calibrated, draft.images), draft.frames
        if record.task != draft.task:
            raise InvalidInputError("episode_id", f"is of the task {record.task!r}", f"an episode of {draft.task!r}")
        usable = tuple(item for item in record.cameras if item.rgb_digest is not None and item.depth_digest is not None)
        if not usable:
            raise InvalidInputError("episode_id", "has no camera with color and depth", "an episode with RGB-D images")
        frames = tuple(read_frame(self._store.blobs, item) for item in usable)
        given = {item["name"]: tuple(item["mask_ids"]) for item in record.given_objects}
        return usable, tuple(_own_mask(frame, given.get(draft.object, ()), draft) for frame in frames)


def _own_mask(frame: RgbdFrame, given_ids: Sequence[int], draft: LabelDraft) -> RgbdFrame:
    """The episode's frame with 1 where its mask image has the object."""
    ids = draft.mask_ids or given_ids
    if frame.mask is None or not ids:
        return replace(frame, mask=None)
    return replace(frame, mask=np.isin(frame.mask, ids).astype(np.int32))


def _masks(draft: LabelDraft, frames: Sequence[RgbdFrame]) -> dict[str, Mask]:
    """By camera where the object is: of clicks in all cameras, else as each camera says."""
    names = [frame.camera.name for frame in frames]
    for field, item in (("clicks", draft.clicks), ("polygons", draft.polygons), ("mask", draft.masks)):
        for name in item:
            if name not in names:
                raise InvalidInputError(f"{field}[{name}]", "is of no camera with color and depth", ", ".join(names))
    masks: dict[str, Mask] = {}
    if draft.clicks:
        masks = masks_from_clicks(frames, draft.clicks)
    for frame in frames:
        name = frame.camera.name
        assert frame.depth_m is not None
        if name in draft.polygons:
            masks[name] = _filled(name, draft.polygons[name], frame.depth_m.shape)
        elif name in draft.masks:
            mask = draft.masks[name]
            if mask.shape != frame.depth_m.shape:
                size = f"{frame.depth_m.shape[1]}x{frame.depth_m.shape[0]}"
                raise InvalidInputError(f"mask_{name}", f"is {mask.shape[1]}x{mask.shape[0]}", f"{size}, as the image")
            masks[name] = np.isin(mask, draft.mask_ids) if draft.mask_ids else mask != 0
        elif not draft.clicks and frame.mask is not None and draft.episode_id is not None:
            masks[name] = frame.mask != 0
    return masks


def _filled(name: str, corners: Sequence[Point], shape: tuple[int, ...]) -> Mask:
    if len(corners) < 3:
        raise InvalidInputError(f"polygons[{name}]", f"has {len(corners)} corners", "three or more (x, y)")
    mask = np.zeros(shape, np.uint8)
    cv2.fillPoly(mask, [np.rint(np.clip(corners, -10_000, 10_000)).astype(np.int32)], 1)
    return mask > 0


def _png(mask: Mask) -> bytes:
    return cv2.imencode(".png", mask.astype(np.uint8))[1].tobytes()


@dataclass(frozen=True, eq=False)
class LearnFromLabels:
    """Learns models for the estimator `registered`. Synchronous: call it in a thread."""

    store: Store
    configure_task: ConfigureTask

    def __call__(
        self, task: str, name: str, symmetric: str | float, *, yaw_may_be_unknown: bool = False
    ) -> Mapping[str, Any]:
        """Learn the object from its last labels, and find it by what was learned from now on; returns its model.

        Every episode is extracted again.

        Raises:
            NotFoundError: if there is no such task.
            InvalidInputError: if the object has no labels, no template can be learned from them, or an episode cannot
                be extracted with it; nothing is changed.
            ConflictError: if the task changed meanwhile.
        """
        symmetry_deg = yaw_symmetry_deg(symmetric)
        with self.store.read() as connection:
            settings = tasks.get(connection, task).settings
            records = labels.all_of(connection, task, name)[-MAX_VIEWS:]
        if not records:
            raise ObjectModelError(
                name, "has no labels", f"POST /tasks/{task}/labels with its mask in 1 to {MAX_VIEWS} views"
            )
        views = [self._view(record) for record in records]
        learned = learn(name, views, symmetry_deg, needs_yaw=not yaw_may_be_unknown)
        model = self._model(records, learned, symmetric, yaw_may_be_unknown=yaw_may_be_unknown).as_json()
        self.configure_task(task, {"object_models": {**settings.get("object_models", {}), name: model}})
        return model

    def _view(self, record: LabelRecord) -> LabelledView:
        frames = tuple(read_frame(self.store.blobs, camera) for camera in record.cameras)
        return LabelledView(frames, record.yaw_deg)

    def _model(
        self, records: Sequence[LabelRecord], learned: Learned, symmetric: str | float, *, yaw_may_be_unknown: bool
    ) -> RegisteredModel:
        template = learned.template
        return RegisteredModel(
            self.store.blobs.put(template.to_bytes()),
            "none" if symmetric == "none" else "yaw" if symmetric == "yaw" else float(symmetric),
            yaw_may_be_unknown,
            views=tuple(records[number].id for number in learned.merged),
            scores=tuple(round(score, 3) for score in template.scores),
            left_out=tuple(LeftOutView(records[number].id, reason) for number, reason in learned.refused.items()),
            num_points=len(template),
        )
