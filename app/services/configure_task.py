"""Change a task's settings; where they decide what is extracted, every episode is extracted again."""

from collections.abc import Mapping
from typing import Any

from app.perception.base import ObjectQuery
from app.pipeline.errors import InvalidInputError
from app.pipeline.wording import checked_name
from app.services.extraction import extract
from app.services.pose_servers import PoseServers
from app.services.stored_images import read_frame
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.errors import ConflictError, NotFoundError
from app.store.records import EpisodeRecord, Extraction, TaskRecord
from app.store.store import Store
from app.store.values import JsonObject


class ConfigureTask:
    """Creates tasks and changes their settings. Synchronous: call it in a thread."""

    def __init__(self, store: Store, pose_servers: PoseServers) -> None:
        self._store = store
        self._pose_servers = pose_servers

    def __call__(self, name: str, changes: Mapping[str, Any]) -> TaskRecord:
        """Set the named settings and keep the others; a new task has the defaults.

        Raises:
            InvalidInputError: if a stored episode cannot be extracted with the new settings; nothing is changed.
            ConflictError: if the task changed meanwhile.
        """
        checked_name("task", name)
        before = self._get(name)
        old = TaskSettings() if before is None else TaskSettings.model_validate(before.settings)
        new = TaskSettings.model_validate({**old.model_dump(), **changes})
        new.workspace.workspace()
        self._pose_servers.check(new.object_models)
        settings = new.model_dump(mode="json")
        if before is None:
            return self._create(name, settings)
        if before.object_names is not None:
            new.check_models(before.object_names)
        extractions = [self._extract(record, new) for record in self._episodes(name)] if new.reads_unlike(old) else []
        with self._store.write() as connection:
            # An episode that came in since would keep what the old settings made of it.
            tasks.require_version(connection, name, before.version)
            if extractions:
                episodes.replace_extractions(connection, name, before.version, extractions)
            return tasks.update_settings(connection, name, settings)

    def _create(self, name: str, settings: JsonObject) -> TaskRecord:
        with self._store.write() as connection:
            task = tasks.get_or_create(connection, name, settings)
            if task.settings != settings:
                raise ConflictError(f"task {name!r} was created meanwhile: read it again and repeat")
        return task

    def _get(self, name: str) -> TaskRecord | None:
        with self._store.read() as connection:
            try:
                return tasks.get(connection, name)
            except NotFoundError:
                return None

    def _episodes(self, task: str) -> tuple[EpisodeRecord, ...]:
        with self._store.read() as connection:
            return episodes.all_of(connection, task)

    def _extract(self, record: EpisodeRecord, settings: TaskSettings) -> Extraction:
        with self._store.read() as connection:
            trajectory = episodes.get_trajectory(connection, record.id)
        try:
            names = [item.name for item in record.objects]
            queries = tuple(map(ObjectQuery.from_json, record.given_objects))
            frames = [read_frame(self._store.blobs, item) for item in record.cameras]
            extracted = extract(trajectory, queries, frames, settings, names)
        except InvalidInputError as error:
            raise InvalidInputError(f"episode {record.id}: {error.field}", error.message, error.valid) from error
        return Extraction(record.id, extracted.keyframes, extracted.objects)
