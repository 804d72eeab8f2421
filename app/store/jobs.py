"""Queries on jobs: re-extractions that outlive a request and a process. Each runs on the caller's transaction.

A process claims a job for some seconds and renews the claim with every batch; when it dies, the claim runs out and the
next process goes on with what is staged. Nothing of a job is seen outside before `finish` switches all over at once.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from uuid import uuid4

from sqlalchemy import Connection, delete, exists, func, insert, select, update

from app.store import episodes, tables, tasks
from app.store.errors import ConflictError, NotFoundError
from app.store.filters import fetch_page
from app.store.records import EpisodeRecord, Extraction, JobRecord, Page
from app.store.values import JsonObject
from app.store.visibility import of_visible_tasks, present

_JOBS, _STAGED, _EPISODES = tables.jobs, tables.staged_extractions, tables.episodes
_OPEN = _JOBS.c.status.in_(("queued", "running"))


class LostClaimError(Exception):
    """Another process has taken the job over, or it is finished."""


def add(connection: Connection, task: str, changes: JsonObject) -> JobRecord:
    """A new job; raises ConflictError if the task has one that is not finished, NotFoundError."""
    tasks.lock(connection, task)
    open_job = connection.scalar(select(_JOBS.c.id).where(_JOBS.c.task == task, _OPEN))
    if open_job is not None:
        raise ConflictError(f"job {open_job} extracts the episodes of {task!r} again: wait for its end")
    now = datetime.now(UTC)
    values = {
        "id": uuid4().hex,
        "task": task,
        "changes": changes,
        "status": "queued",
        "num_episodes": episodes.number_of(connection, task),
        "num_extracted": 0,
        "claimed_until": now,
        "created_at": now,
    }
    connection.execute(insert(_JOBS).values(values))
    return get(connection, str(values["id"]))


def get(connection: Connection, job_id: str) -> JobRecord:
    """The job; raises NotFoundError."""
    row = connection.execute(select(_JOBS).where(_JOBS.c.id == job_id)).first()
    if row is None or not present().has_task(row.task):
        raise NotFoundError("job", job_id)
    return JobRecord(**row._mapping)


def list_page(
    connection: Connection, task: str | None = None, limit: int = 50, cursor: int | None = None
) -> Page[JobRecord]:
    """Return jobs, newest first, of one task or of all visible ones."""
    query = of_visible_tasks(select(_JOBS), _JOBS.c.task, task)
    return fetch_page(connection, _JOBS, query, limit, cursor, lambda row: JobRecord(**row._mapping))


def has_open(connection: Connection, task: str) -> bool:
    """Whether a job of the task is not finished."""
    return bool(connection.scalar(select(exists().where(_JOBS.c.task == task, _OPEN))))


def claim(connection: Connection, lease: timedelta) -> JobRecord | None:
    """The oldest job that no process has claimed, claimed for `lease`; None without one. In a write transaction."""
    now = datetime.now(UTC)
    free = select(_JOBS).where(_OPEN, _JOBS.c.claimed_until <= now).order_by(_JOBS.c.sequence).limit(1)
    # Processes that claim at the same time get different jobs. SQLite ignores it: there writers are alone.
    row = connection.execute(free.with_for_update(skip_locked=True)).first()
    if row is None:
        return None
    values = {"status": "running", "claim": uuid4().hex, "claimed_until": now + lease}
    connection.execute(update(_JOBS).where(_JOBS.c.id == row.id).values(values))
    return get(connection, row.id)


def pending(connection: Connection, job: JobRecord, limit: int) -> tuple[EpisodeRecord, ...]:
    """The task's next episodes that the job has not extracted, oldest first."""
    staged = select(_STAGED.c.episode).where(_STAGED.c.job == job.id, _STAGED.c.episode == _EPISODES.c.id)
    query = select(*episodes.LISTED).where(_EPISODES.c.task == job.task, ~exists(staged))
    return tuple(map(episodes.record_of, connection.execute(query.order_by(_EPISODES.c.sequence).limit(limit))))


def stage(connection: Connection, job: JobRecord, extractions: Sequence[Extraction], lease: timedelta) -> None:
    """Keep a batch and renew the claim; raises LostClaimError."""
    rows = [
        {"job": job.id, "episode": item.episode_id, "keyframes": item.keyframes, "objects": item.objects}
        for item in extractions
    ]
    _change(connection, job, {"claimed_until": datetime.now(UTC) + lease})
    if rows:  # unless each of the batch was deleted meanwhile
        connection.execute(insert(_STAGED), rows)
    number = select(func.count()).select_from(_STAGED).where(_STAGED.c.job == job.id).scalar_subquery()
    of_task = episodes.number_of(connection, job.task)
    _change(connection, job, {"num_extracted": number, "num_episodes": of_task})


def release(connection: Connection, job: JobRecord) -> None:
    """Let another process go on at once; raises LostClaimError."""
    _change(connection, job, {"claimed_until": datetime.now(UTC)})


def finish(connection: Connection, job: JobRecord) -> None:
    """Put what was extracted in the place of the old; raises LostClaimError.

    Call it after `tasks.lock` and when nothing is `pending`, and set the task's settings, in one write transaction.
    """
    staged = select(_STAGED.c.keyframes).where(_STAGED.c.job == job.id, _STAGED.c.episode == _EPISODES.c.id)
    connection.execute(
        update(_EPISODES)
        .where(_EPISODES.c.task == job.task)
        .values(
            keyframes=staged.scalar_subquery(),
            objects=staged.with_only_columns(_STAGED.c.objects).scalar_subquery(),
        )
    )
    _end(connection, job, {"status": "done"})


def fail(connection: Connection, job: JobRecord, error: str) -> None:
    """Give up; the task stays as it was. Raises LostClaimError."""
    _end(connection, job, {"status": "failed", "error": error})


def _end(connection: Connection, job: JobRecord, values: JsonObject) -> None:
    _change(connection, job, {**values, "finished_at": datetime.now(UTC)})
    connection.execute(delete(_STAGED).where(_STAGED.c.job == job.id))


def _change(connection: Connection, job: JobRecord, values: JsonObject) -> None:
    mine = (_JOBS.c.id == job.id, _JOBS.c.claim == job.claim, _JOBS.c.status == "running")
    if connection.execute(update(_JOBS).where(*mine).values(values)).rowcount == 0:
        raise LostClaimError(job.id)
