"""Where an object model finds its object in stored episodes, before the task is given the model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.perception.base import ObjectQuery
from app.perception.models import model_from_json
from app.perception.registry import estimate_poses
from app.services.pose_servers import PoseServers
from app.services.scene_images import read_frame
from app.services.templates import with_templates
from app.store import episodes, tasks
from app.store.errors import NotFoundError
from app.store.records import EpisodeRecord
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import ObjectPose


@dataclass(frozen=True, eq=False)
class Tried:
    """What a model makes of an episode; all None where it has no images.

    Attributes:
        refusal: why the object is not found.
    """

    episode_id: str
    pose: ObjectPose | None = None
    refusal: InvalidInputError | None = None


@dataclass(frozen=True, eq=False)
class TryModel:
    """Tries object models out; nothing is stored. Synchronous: call it in a thread."""

    store: Store
    pose_servers: PoseServers

    def __call__(self, task: str, name: str, model: Mapping[str, Any], ids: Sequence[str]) -> tuple[Tried, ...]:
        """What the model makes of each episode, in their order.

        Raises:
            NotFoundError: if there is no such task, or it has no such episode.
            InvalidInputError: if the model is not valid, or its template is not stored.
        """
        with self.store.read() as connection:
            tasks.get(connection, task)
            records = episodes.by_ids(connection, task, ids)
        if missing := [id_ for id_ in ids if id_ not in records]:
            raise NotFoundError(f"episode of task {task!r}", missing[0])
        query = ObjectQuery(name, model=model_from_json(name, model, "model"))
        self.pose_servers.check({name: model})
        (query,) = with_templates([query], self.store.blobs)
        return tuple(self._tried(record, query) for record in records.values())

    def _tried(self, record: EpisodeRecord, query: ObjectQuery) -> Tried:
        if not any(camera.has_rgbd for camera in record.cameras):
            return Tried(record.id)
        frames = [read_frame(self.store.blobs, camera) for camera in record.cameras]
        try:
            (pose,) = estimate_poses("", [query], frames)
        except InvalidInputError as refusal:
            return Tried(record.id, refusal=refusal)
        return Tried(record.id, pose)
