"""Change settings of a task; where they decide what is extracted, its episodes are extracted again, also by a job."""

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import Connection

from app.services.poses import PoseServers
from app.services.task_settings import MERGED, TaskSettings
from app.services.teach.extract import extract_all_again
from app.services.teach.workspace import NUM_FIRST, Extent, spanned, widened
from app.store import episodes, jobs, tasks
from app.store.errors import ConflictError
from app.store.records import JobRecord, TaskRecord
from app.store.store import Store
from app.store.values import JsonObject
from roboprompt_client.types.names import checked_name

MAX_AT_ONCE = 200  # episodes that a request extracts again itself: some seconds


class ConfigureTask:
    """Creates tasks and changes their settings. Synchronous: call it in a thread.

    Args:
        max_at_once: episodes that a request extracts again itself; more become a job.
    """

    def __init__(self, store: Store, pose_servers: PoseServers, max_at_once: int = MAX_AT_ONCE) -> None:
        self._store = store
        self._pose_servers = pose_servers
        self._max_at_once = max_at_once

    def __call__(
        self,
        name: str,
        changes: Mapping[str, Any],
        learned: Mapping[str, Mapping[str, Any]] | None = None,
        version: int | None = None,
    ) -> TaskRecord:
        """Set the named settings and keep the others; a new task has the defaults.

        Args:
            learned: object models that the task is given beside those that it has by now.
            version: of the task that the changes were made from; None: whichever there is.

        Raises:
            InvalidInputError: if a stored episode cannot be extracted with the new settings; nothing is changed.
            ConflictError: if the task changed meanwhile.
        """
        return self._at_once(name, changes, *self._planned(name, changes, learned, version))

    def _at_once(
        self, name: str, changes: Mapping[str, Any], before: TaskRecord | None, old: TaskSettings, new: TaskSettings
    ) -> TaskRecord:
        if before is None:
            return self._create(name, new.model_dump(mode="json"))
        with self._store.read() as connection:
            records = episodes.all_of(connection, name) if "workspace" in changes or new.reads_unlike(old) else ()
        extractions = extract_all_again(self._store, records, new) if new.reads_unlike(old) else []
        read: Sequence[Extent] = extractions or records
        if len(read) < len(records):
            raise ConflictError(f"an episode of task {name!r} was deleted meanwhile: read it again and repeat")
        shown = [item for item, record in zip(read, records, strict=True) if not record.left_out]
        settings = with_workspace(new, shown, changes).model_dump(mode="json")
        with self._store.write() as connection:
            # An episode that came in since would keep what the old settings made of it.
            tasks.require_version(connection, name, before.version)
            if extractions:
                require_no_job(connection, name)
                episodes.replace_extractions(connection, name, before.version, extractions)
            return tasks.update_settings(connection, name, settings)

    def at_once_or_as_job(
        self, name: str, changes: Mapping[str, Any], version: int | None = None
    ) -> TaskRecord | JobRecord:
        """Do as the call does; if more than `max_at_once` episodes must be extracted again, return a job that does it.

        Raises:
            as the call; also ConflictError: if the task has such a job already.
        """
        before, old, new = self._planned(name, changes, version=version)
        with self._store.read() as connection:
            number = episodes.number_of(connection, name) if new.reads_unlike(old) else 0
        if before is None or number <= self._max_at_once:
            return self._at_once(name, changes, before, old, new)
        wanted = new.model_dump(mode="json")
        # Only what was asked for: limits that are tightened before the job ends must stay.
        kept = {key: _named(wanted[key], changes[key]) if key in MERGED else wanted[key] for key in changes}
        with self._store.write() as connection:
            if version is not None:
                tasks.require_version(connection, name, version)
            return jobs.add(connection, name, kept)

    def _planned(
        self,
        name: str,
        changes: Mapping[str, Any],
        learned: Mapping[str, Mapping[str, Any]] | None = None,
        version: int | None = None,
    ) -> tuple[TaskRecord | None, TaskSettings, TaskSettings]:
        """The task as it is, and its settings as they are and as they will be."""
        checked_name("task", name)
        with self._store.read() as connection:
            before = tasks.find(connection, name)
        if version is not None and (before is None or before.version != version):
            now = "is gone" if before is None else f"is at version {before.version}"
            raise ConflictError(f"task {name!r} {now}, no longer at {version}: read it again and repeat")
        old = TaskSettings() if before is None else TaskSettings.model_validate(before.settings)
        new = old.changed({**changes, "object_models": {**old.object_models, **learned}} if learned else changes)
        new.workspace.workspace()
        self._pose_servers.check(new.object_models)
        if before is not None and before.object_names is not None:
            new.check_models(before.object_names)
        return before, old, new

    def _create(self, name: str, settings: JsonObject) -> TaskRecord:
        with self._store.write() as connection:
            task = tasks.get_or_create(connection, name, settings)
            if task.settings != settings:
                raise ConflictError(f"task {name!r} was created meanwhile: read it again and repeat")
        return task


def with_workspace(settings: TaskSettings, episodes: Sequence[Extent], changes: Mapping[str, Any]) -> TaskSettings:
    """Changed settings with a workspace for the task's episodes, where it follows from them.

    Episodes that reach far beyond the others widen it only if the change names the workspace.
    """
    box = settings.workspace
    if "workspace" in changes:
        box = spanned(box, episodes)
    else:
        for episode in episodes:
            box = widened(box, episode, episodes[:NUM_FIRST])
    return settings.model_copy(update={"workspace": box})


def _named(settings: JsonObject, change: Mapping[str, Any]) -> JsonObject:
    return {key: settings[key] for key in change}


def require_no_job(connection: Connection, name: str) -> None:
    """Refuse what would meet a job that extracts the task's episodes again; raises ConflictError if there is one."""
    if jobs.has_open(connection, name):
        raise ConflictError(f"a job extracts the episodes of {name!r} again: wait for its end, see GET /jobs")
