"""Labelled views of objects: previewed, taken in, and learned from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from app.perception.object_model import ObjectModelError
from app.perception.registered.learn import LabelledView, Learned, learn
from app.perception.registered.marks import Mask
from app.perception.registered.model import LeftOutView, RegisteredModel, yaw_symmetry_deg
from app.services.scene_images import read_frame
from app.services.teach.configure import ConfigureTask
from app.services.teach.label_masks import LabelDraft, LabelViews, yaw_deg
from app.store import labels, tasks
from app.store.labels import LabelRecord
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError

MAX_LABELS = 100  # of a task
MAX_VIEWS = 10  # that an object is learned from


@dataclass(frozen=True, eq=False)
class LabelPreview:
    """What a label would say.

    Attributes:
        masks: by camera.
    """

    masks: Mapping[str, Mask]
    yaw_deg: float | None


class LabelObjects:
    """Stores labels. Synchronous: call it in a thread."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._views = LabelViews(store)

    def preview(self, draft: LabelDraft) -> LabelPreview:
        """What the draft says; nothing is stored.

        Raises:
            as the call.
        """
        view = self._views.view(draft, store_images=False)
        return LabelPreview(self._views.masks(draft, view), yaw_deg(draft, view))

    def __call__(self, draft: LabelDraft) -> LabelRecord:
        """Store where the object is in each camera's image.

        Raises:
            NotFoundError: if there is no such task or episode.
            InvalidInputError: if no mask follows from the draft, the images are unusable, or there are too many labels.
        """
        view = self._views.view(draft, store_images=True)
        masks, yaw = self._views.masks(draft, view), yaw_deg(draft, view)
        digests = {name: self._store.blobs.put(_png(mask)) for name, mask in masks.items() if mask.any()}
        labelled = tuple(replace(camera, mask_digest=digests.get(camera.name)) for camera in view.cameras)
        counts = {name: int(mask.sum()) for name, mask in masks.items()}
        with self._store.write() as connection:
            if labels.number_of(connection, draft.task) >= MAX_LABELS:
                raise InvalidInputError("task", f"has {MAX_LABELS} labels", "fewer: delete those that did not merge")
            return labels.add(connection, draft.task, draft.object, labelled, counts, yaw, draft.episode_id)


def _png(mask: Mask) -> bytes:
    return cv2.imencode(".png", mask.astype(np.uint8))[1].tobytes()


@dataclass(frozen=True, eq=False)
class LearnFromLabels:
    """Learns models for the estimator `registered`. Synchronous: call it in a thread."""

    store: Store
    configure_task: ConfigureTask

    def __call__(
        self, task: str, name: str, symmetric: str | float, *, yaw_may_be_unknown: bool = False, dry_run: bool = False
    ) -> Mapping[str, Any]:
        """Learn the object from its last labels, and find it by what was learned from now on; returns its model.

        Every episode is extracted again.

        Args:
            dry_run: leave the task as it is.

        Raises:
            NotFoundError: if there is no such task.
            InvalidInputError: if the object has no labels, no template can be learned from them, or an episode cannot
                be extracted with it; nothing is changed.
            ConflictError: if the task changed meanwhile.
        """
        symmetry_deg = yaw_symmetry_deg(symmetric)
        with self.store.read() as connection:
            tasks.get(connection, task)
            records = labels.all_of(connection, task, name)[-MAX_VIEWS:]
        if not records:
            raise ObjectModelError(
                name, "has no labels", f"POST /tasks/{task}/labels with its mask in 1 to {MAX_VIEWS} views"
            )
        views = [self._view(record) for record in records]
        learned = learn(name, views, symmetry_deg, needs_yaw=not yaw_may_be_unknown)
        model = self._model(records, learned, symmetric, yaw_may_be_unknown=yaw_may_be_unknown).as_json()
        if not dry_run:
            self.configure_task(task, {}, learned={name: model})
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
