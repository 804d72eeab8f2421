"""Earlier settings of a task, so that a change can be seen and undone. Each query runs on the caller's transaction."""

from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, delete, insert, select

from app.store import tables
from app.store.records import TaskRecord
from app.store.values import JsonObject
from app.store.visibility import present

MAX_KEPT = 100  # of a task, the newest
_REPLACED = tables.replaced_settings


@dataclass(frozen=True)
class ReplacedSettings:
    """Settings that a task had until they were changed."""

    task: str
    version: int  # the last version of the task that had them
    replaced_at: datetime
    replaced_by: str  # the API key by its name and id, `local`, or a job
    settings: JsonObject


def differing(before: JsonObject, after: JsonObject) -> list[str]:
    """Return the names of the settings that differ, but for values that follow from episodes."""
    one, other = _set_by_people(before), _set_by_people(after)
    return [name for name in {**one, **other} if one.get(name) != other.get(name)]


def keep(connection: Connection, task: TaskRecord, after: JsonObject) -> None:
    """Keep the task's settings before they are replaced, unless only values change that follow from episodes."""
    if not differing(task.settings, after):
        return
    record = ReplacedSettings(task.name, task.version, datetime.now(UTC), present().actor, task.settings)
    connection.execute(insert(_REPLACED).values(vars(record)))
    of_task = select(_REPLACED.c.version).where(_REPLACED.c.task == task.name).order_by(_REPLACED.c.version.desc())
    if (oldest := connection.scalar(of_task.offset(MAX_KEPT).limit(1))) is not None:
        connection.execute(delete(_REPLACED).where(_REPLACED.c.task == task.name, _REPLACED.c.version <= oldest))


def list_all(connection: Connection, task: str) -> tuple[ReplacedSettings, ...]:
    """The earlier settings of a task, newest first."""
    query = select(_REPLACED).where(_REPLACED.c.task == task).order_by(_REPLACED.c.version.desc())
    return tuple(ReplacedSettings(**row._mapping) for row in connection.execute(query))


def _set_by_people(settings: JsonObject) -> JsonObject:
    box = settings.get("workspace") or {}
    return {**settings, "workspace": box["preset"] if box.get("preset") else box, "num_joints": None}
