"""What the store knows of an upload's task: read in one transaction, and held against the task where it commits."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from sqlalchemy import Connection

from app.perception.base import ObjectQuery
from app.pipeline.plans import Recording
from app.services.predict.demonstrations import recordings_of
from app.services.task_settings import TaskSettings
from app.services.teach.room import FIRST
from app.store import episodes, tasks
from app.store.records import DemonstrationRecord
from app.store.values import JsonObject

MAX_COMPARED = 50  # demonstrations that an upload is held against


@dataclass(frozen=True, eq=False)
class KnownTask:
    """A task as an upload found it.

    Attributes:
        stored: its settings, or those that a new task is made with.
        object_names: in its order; None while it has no episode.
        demonstrations: its first.
        recordings: of these, for an upload that has some of its objects, but not all, or others besides.
    """

    name: str
    is_new: bool
    stored: JsonObject
    object_names: tuple[str, ...] | None = None
    demonstrations: tuple[DemonstrationRecord, ...] = ()
    recordings: Sequence[Recording] | None = None

    @classmethod
    def read(cls, connection: Connection, name: str, objects: Sequence[ObjectQuery]) -> "KnownTask":
        """The task that an episode with these objects is for."""
        if (task := tasks.find(connection, name)) is None:
            by_masks = all(query.position_m is None and query.mask_ids for query in objects)
            settings = TaskSettings(pose_estimator="masks" if by_masks else "given")
            return cls(name, True, settings.model_dump(mode="json"))
        shown = episodes.demonstrations(connection, name, MAX_COMPARED)
        known = cls(name, False, task.settings, task.object_names, shown)
        own, sent = set(task.object_names or ()), {query.name for query in objects}
        if own == sent or own.isdisjoint(sent):
            return known
        return replace(known, recordings=recordings_of(connection, shown, known.settings))

    @cached_property
    def settings(self) -> TaskSettings:
        """The settings, checked."""
        return TaskSettings.model_validate(self.stored)

    @property
    def first(self) -> tuple[DemonstrationRecord, ...]:
        """The demonstrations that say how large the task is."""
        return self.demonstrations[:FIRST]

    def locked(self, connection: Connection) -> "KnownTask | None":
        """The task as it is now, until the transaction ends; None if it is gone, or has episodes extracted otherwise.

        Its workspace may have grown, and others of its demonstrations be the first.
        """
        if self.is_new:
            task = tasks.get_or_create(connection, self.name, self.stored)
        elif (found := tasks.find(connection, self.name, lock=True)) is not None:
            task = found
        else:
            return None
        if (task.object_names, _extracting(task.settings)) != (self.object_names, _extracting(self.stored)):
            return None
        shown = episodes.demonstrations(connection, self.name, FIRST)
        return replace(self, stored=task.settings, demonstrations=shown)


def _extracting(settings: JsonObject) -> JsonObject:
    """The settings that an extraction depends on: not the workspace, which grows with every episode that needs it."""
    return {name: value for name, value in settings.items() if name != "workspace"}
