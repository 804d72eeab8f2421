"""Queries on tasks. Each runs on the caller's transaction."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, bindparam, delete, func, select, update
from sqlalchemy.dialects.postgresql import insert as postgresql_insert
from sqlalchemy.dialects.sqlite import insert as sqlite_insert

from app.store import tables
from app.store.errors import NotFoundError
from app.store.records import TaskCounts, TaskRecord
from app.store.values import JsonObject

_TASKS = tables.tasks
# Every prediction asks this, and building the statement would take as long as running it.
_GET = select(_TASKS).where(_TASKS.c.name == bindparam("name"))


def find(connection: Connection, name: str, *, lock: bool = False) -> TaskRecord | None:
    """The task, if there is one; with `lock` no other transaction changes it until this one ends."""
    # NO KEY: predictions that refer to the task are inserted meanwhile. SQLite, where writers are alone, ignores it.
    query = _GET.with_for_update(key_share=True) if lock else _GET
    row = connection.execute(query, {"name": name}).first()
    return None if row is None else TaskRecord(**row._mapping)


def get(connection: Connection, name: str, *, lock: bool = False) -> TaskRecord:
    """As `find`; raises NotFoundError, too."""
    if (task := find(connection, name, lock=lock)) is None:
        raise NotFoundError("task", name)
    return task


def lock(connection: Connection, name: str) -> TaskRecord:
    """The task, which no other transaction changes until this one ends; raises NotFoundError."""
    return get(connection, name, lock=True)


def list_all(connection: Connection) -> tuple[TaskRecord, ...]:
    """Every task, by name."""
    rows = connection.execute(select(_TASKS).order_by(_TASKS.c.name))
    return tuple(TaskRecord(**row._mapping) for row in rows)


def most_recently_used(connection: Connection, limit: int) -> tuple[str, ...]:
    """The tasks with episodes that were predicted last, then those that changed last."""
    predicted = select(func.max(tables.predictions.c.sequence)).where(tables.predictions.c.task == _TASKS.c.name)
    last = func.coalesce(predicted.scalar_subquery(), 0)
    query = select(_TASKS.c.name).where(_TASKS.c.object_names.is_not(None))
    return tuple(connection.scalars(query.order_by(last.desc(), _TASKS.c.updated_at.desc()).limit(limit)))


def get_or_create(connection: Connection, name: str, settings: JsonObject) -> TaskRecord:
    """The task, locked until the transaction ends; created with `settings` if it is new.

    Call it in a write transaction. What it returns (object names, settings, version) cannot change before the commit,
    so the caller's checks against it hold.
    """
    if (task := find(connection, name, lock=True)) is not None:
        return task
    now = datetime.now(UTC)
    values = {"name": name, "version": 1, "settings": settings, "created_at": now, "updated_at": now}
    insert = postgresql_insert if connection.dialect.name == "postgresql" else sqlite_insert
    # Another transaction may be creating it, too: this one then waits for that one's commit.
    connection.execute(insert(_TASKS).values(values).on_conflict_do_nothing())
    return lock(connection, name)


def update_settings(connection: Connection, name: str, settings: JsonObject) -> TaskRecord:
    """Replace the task's settings; if they differ the version grows.

    Raises NotFoundError.
    """
    task = lock(connection, name)
    if task.settings != settings:
        change(connection, name, {"settings": settings})
    return get(connection, name)


def change(connection: Connection, name: str, values: Mapping[str, Any]) -> None:
    """Set columns of the task; its version grows."""
    grown = {**values, "version": _TASKS.c.version + 1, "updated_at": datetime.now(UTC)}
    connection.execute(update(_TASKS).where(_TASKS.c.name == name).values(grown))


def rewrite(connection: Connection, name: str) -> None:
    """Write the task's row as it is: fails where nothing can be written."""
    connection.execute(update(_TASKS).where(_TASKS.c.name == name).values(name=_TASKS.c.name))


def remove(connection: Connection, name: str) -> None:
    """Delete a task with its episodes, predictions and labels; raises NotFoundError.

    Images stay until nothing refers to them, see `Store.sweep`.
    """
    # A request that adds an episode or a prediction waits, and then finds no task.
    if connection.execute(select(_TASKS.c.name).where(_TASKS.c.name == name).with_for_update()).first() is None:
        raise NotFoundError("task", name)
    for table in (tables.predictions, tables.episodes, tables.labels):
        connection.execute(delete(table).where(table.c.task == name))
    connection.execute(delete(_TASKS).where(_TASKS.c.name == name))


def num_episodes(connection: Connection) -> dict[str, int]:
    """How many episodes each task has that has any."""
    query = select(tables.episodes.c.task, func.count()).group_by(tables.episodes.c.task)
    return {row[0]: row[1] for row in connection.execute(query)}


def counts(connection: Connection) -> dict[str, TaskCounts]:
    """How much is stored of every task."""
    predictions = tables.predictions
    outcomes = select(
        predictions.c.task,
        func.count(),
        func.count().filter(predictions.c.outcome_success.is_(True)),
        func.count().filter(predictions.c.outcome_success.is_(False)),
    )
    outcomes = outcomes.group_by(predictions.c.task)
    of_episodes = num_episodes(connection)
    num_predictions: dict[str, Sequence[int]] = {row[0]: row[1:] for row in connection.execute(outcomes)}
    names = connection.scalars(select(_TASKS.c.name).order_by(_TASKS.c.name))
    return {name: TaskCounts(of_episodes.get(name, 0), *num_predictions.get(name, (0, 0, 0))) for name in names}
