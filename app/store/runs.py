"""Queries on runs: robots that carry something out now. Each runs on the caller's transaction."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, and_, delete, insert, select, update

from app.store import audit, tables, tasks
from app.store.database import lock
from app.store.errors import NotFoundError
from app.store.values import JsonObject
from app.store.visibility import of_visible_tasks, present

LIVING = timedelta(minutes=1)  # after this without a report a run has ended
_RUNS = tables.runs


@dataclass(frozen=True)
class RunRecord:
    """A robot at work; `state` is its last report, `stop` whether the run was stopped."""

    id: str
    task: str
    key_id: str | None  # of the API key that reports it; None where none was needed
    state: JsonObject
    stop: bool
    created_at: datetime
    heard_at: datetime


def report(connection: Connection, run_id: str, task: str, state: JsonObject) -> bool:
    """Record a robot's report of a new run, or of a run of the same key. Return whether the robot must stop.

    Raises NotFoundError if there is no such task, or the run is another key's or task's.
    """
    present().require_task(task)
    lock(connection, f"run {run_id}")  # a client that gave up waiting says it again
    now = datetime.now(UTC)
    row = connection.execute(select(_RUNS).where(_RUNS.c.id == run_id)).first()
    if row is None:
        tasks.lock(connection, task)
        connection.execute(delete(_RUNS).where(_RUNS.c.heard_at < now - LIVING))
        values = {"id": run_id, "task": task, "key_id": present().key_id or None, "stop": False, "created_at": now}
        connection.execute(insert(_RUNS).values(**values, state=state, heard_at=now))
        return False
    if (row.task, row.key_id) != (task, present().key_id or None):
        raise NotFoundError("run", run_id)
    connection.execute(update(_RUNS).where(_RUNS.c.id == run_id).values(state=state, heard_at=now))
    return bool(row.stop)


def end(connection: Connection, run_id: str) -> bool:
    """Delete a run of the present key. Return whether it was stopped. Raises NotFoundError."""
    own = and_(_RUNS.c.id == run_id, _RUNS.c.key_id == (present().key_id or None))
    stopped = connection.scalar(select(_RUNS.c.stop).where(own).with_for_update())
    if stopped is None:
        raise NotFoundError("run", run_id)
    connection.execute(delete(_RUNS).where(own))
    return bool(stopped)


def stop(connection: Connection, run_id: str) -> RunRecord:
    """Stop a run for good: every later answer tells its robot to stop. Raises NotFoundError."""
    row = connection.execute(select(_RUNS).where(_RUNS.c.id == run_id)).first()
    if row is None or not present().has_prediction(row.task, row.key_id):
        raise NotFoundError("run", run_id)
    if not row.stop:
        connection.execute(update(_RUNS).where(_RUNS.c.id == run_id).values(stop=True))
        audit.record(connection, "run.stopped", run_id, {"task": row.task})
    return replace(RunRecord(**row._mapping), stop=True)


def living(connection: Connection) -> tuple[RunRecord, ...]:
    """Return the visible runs that were reported within the last minute, oldest first."""
    since = datetime.now(UTC) - LIVING
    query = of_visible_tasks(select(_RUNS).where(_RUNS.c.heard_at >= since), _RUNS.c.task).order_by(_RUNS.c.created_at)
    rows = connection.execute(query)
    return tuple(RunRecord(**row._mapping) for row in rows if present().has_prediction(row.task, row.key_id))
