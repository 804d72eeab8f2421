"""Create tasks and change their settings; what is extracted from their episodes follows when these are next read."""

from collections.abc import Mapping
from typing import Any

from app.services.extract import extract_again
from app.services.poses import PoseServers
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.errors import ConflictError
from app.store.records import Extraction, TaskRecord
from app.store.store import Store
from roboprompt_client.types.names import checked_name


class ConfigureTask:
    """Creates tasks and changes their settings. Synchronous: call it in a thread."""

    def __init__(self, store: Store, pose_servers: PoseServers) -> None:
        self._store = store
        self._pose_servers = pose_servers

    def __call__(
        self,
        name: str,
        changes: Mapping[str, Any],
        learned: Mapping[str, Mapping[str, Any]] | None = None,
        version: int | None = None,
    ) -> TaskRecord:
        """Set the named settings and keep the others; a new task has the defaults.

        Args:
            learned: object models that the task is given beside those that it has by now; each must find its object in
                the task's episodes.
            version: of the task that the changes were made from; None: whichever there is.

        Raises:
            InvalidInputError: if a setting is not valid or does not fit the task's objects, or a learned model does not
                find its object in an episode; nothing is changed.
            ConflictError: if the task changed meanwhile.
        """
        checked_name("task", name)
        extractions = self._extracted_with(name, learned) if learned else []
        with self._store.write() as connection:
            before = tasks.find(connection, name, lock=True)
            if version is not None and (before is None or before.version != version):
                now = "is gone" if before is None else f"is at version {before.version}"
                raise ConflictError(f"task {name!r} {now}, no longer at {version}: read it again and repeat")
            old = TaskSettings() if before is None else TaskSettings.read(connection, before)
            new = old.changed({**changes, "object_models": {**old.object_models, **learned}} if learned else changes)
            self._check(new, before)
            if before is not None:
                if extractions:
                    episodes.replace_extractions(connection, extractions)
                return tasks.update_settings(connection, name, new.stored())
            task = tasks.get_or_create(connection, name, new.stored())
            if task.settings != new.stored():
                raise ConflictError(f"task {name!r} was created meanwhile: read it again and repeat")
        return task

    def _extracted_with(self, name: str, learned: Mapping[str, Mapping[str, Any]]) -> list[Extraction]:
        """Return what learned models make of the episodes that prompts are made of."""
        with self._store.read() as connection:
            if (task := tasks.find(connection, name)) is None:
                return []
            old = TaskSettings.read(connection, task)
            records = [record for record in episodes.all_of(connection, name) if not record.left_out]
        new = old.changed({"object_models": {**old.object_models, **learned}})
        return [extract_again(self._store, record, new) for record in records]

    def _check(self, settings: TaskSettings, task: TaskRecord | None) -> None:
        settings.workspace.workspace()
        self._pose_servers.check(settings.object_models)
        if task is not None and task.object_names is not None:
            settings.check_models(task.object_names)
