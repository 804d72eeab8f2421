"""Queries on labels: views of an object with its masks. Each runs on the caller's transaction."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from uuid import uuid4

from sqlalchemy import Connection, delete, func, insert, select

from app.store import tables, tasks
from app.store.errors import NotFoundError
from app.store.values import CameraRecord

_LABELS = tables.labels


@dataclass(frozen=True)
class LabelRecord:
    """One view of an object."""

    id: str
    task: str
    object: str
    cameras: tuple[CameraRecord, ...]  # with the images of the view; the masks are this object's: 1 where it is
    num_pixels: Mapping[str, int]  # of the mask, by camera
    yaw_deg: float | None  # of the object's x axis about the vertical, to within ten degrees, or None
    episode_id: str | None  # whose first frame it is; None for images of its own
    created_at: datetime


def add(
    connection: Connection,
    task: str,
    name: str,
    cameras: tuple[CameraRecord, ...],
    num_pixels: Mapping[str, int],
    yaw_deg: float | None,
    episode_id: str | None,
) -> LabelRecord:
    """A new label of the object `name`; raises NotFoundError."""
    tasks.lock(connection, task)
    record = LabelRecord(uuid4().hex, task, name, cameras, dict(num_pixels), yaw_deg, episode_id, datetime.now(UTC))
    connection.execute(insert(_LABELS).values(vars(record)))
    return record


def all_of(connection: Connection, task: str, name: str | None = None) -> tuple[LabelRecord, ...]:
    """The task's labels in the order they came, those of one object or all; raises NotFoundError."""
    tasks.get(connection, task)
    query = select(*(_LABELS.c[field.name] for field in fields(LabelRecord))).where(_LABELS.c.task == task)
    if name is not None:
        query = query.where(_LABELS.c.object == name)
    return tuple(LabelRecord(*row) for row in connection.execute(query.order_by(_LABELS.c.sequence)))


def number_of(connection: Connection, task: str) -> int:
    """How many labels the task has."""
    return connection.execute(select(func.count()).where(_LABELS.c.task == task)).scalar_one()


def remove(connection: Connection, task: str, label_id: str) -> None:
    """Delete a label; what was learned from it stays. Raises NotFoundError."""
    tasks.get(connection, task)
    query = delete(_LABELS).where(_LABELS.c.task == task, _LABELS.c.id == label_id)
    if not connection.execute(query).rowcount:
        raise NotFoundError("label", label_id)
