"""Queries on labels: views of an object with its masks. Each runs on the caller's transaction."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
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

    task: str
    object: str
    cameras: tuple[CameraRecord, ...]  # with the images of the view; the masks are this object's: 1 where it is
    num_pixels: Mapping[str, int]  # of the mask, by camera
    yaw_deg: float | None = None  # of the object's x axis about the vertical, to within ten degrees, or None
    episode_id: str | None = None  # whose first frame it is; None for images of its own
    id: str = field(default_factory=lambda: uuid4().hex)
    created_at: datetime = field(default_factory=lambda: datetime.now(UTC))


def add(connection: Connection, record: LabelRecord) -> LabelRecord:
    """Store a new label; raises NotFoundError if there is no such task."""
    tasks.lock(connection, record.task)
    connection.execute(insert(_LABELS).values(vars(record)))
    return record


def all_of(connection: Connection, task: str, name: str | None = None) -> tuple[LabelRecord, ...]:
    """The task's labels in the order they came, those of one object or all; raises NotFoundError."""
    tasks.get(connection, task)
    query = select(*(_LABELS.c[item.name] for item in fields(LabelRecord))).where(_LABELS.c.task == task)
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
