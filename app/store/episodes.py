"""Queries on episodes. Each runs on the caller's transaction."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from sqlalchemy import Connection, Row, Text, bindparam, cast, delete, exists, func, insert, or_, select, update

from app.store import tables, tasks
from app.store.database import lock, writes
from app.store.errors import NotFoundError
from app.store.filters import EpisodeFilter, fetch_page
from app.store.records import DemonstrationRecord, EpisodeDraft, EpisodeRecord, Extraction, ExtractionKeys, Page
from app.store.values import ObjectRecord

MAX_INSTRUCTIONS = 50
EVERY = EpisodeFilter()
_EPISODES = tables.episodes
_WITHOUT_TRAJECTORY = [column for column in _EPISODES.c if column.name != "trajectory"]
LISTED = [column for column in _WITHOUT_TRAJECTORY if column.name != "extra"]
_SHOWN = _EPISODES.c.left_out.is_(False)  # in prompts
_SCENES = (
    select(_EPISODES.c.id, _EPISODES.c.objects)
    .where(_EPISODES.c.task == bindparam("task"), _SHOWN)
    .order_by(_EPISODES.c.sequence)
)
_FOR_PROMPTS = [_EPISODES.c[field.name] for field in fields(DemonstrationRecord)]


def add(connection: Connection, draft: EpisodeDraft) -> EpisodeRecord:
    """Store an episode of an existing task: its version grows, and its object names are those that all episodes have.

    Call it after `tasks.get_or_create` in the same write transaction, and compare `object_names` in between.
    """
    values = {name: value for name, value in vars(draft).items() if name != "sequence"}
    sequence = connection.execute(insert(_EPISODES).values(values).returning(_EPISODES.c.sequence)).scalar_one()
    own = [record.name for record in draft.objects]
    names = [name for name in tasks.get(connection, draft.task).object_names or own if name in own]
    tasks.change(connection, draft.task, {"object_names": names})
    del values["trajectory"]
    return EpisodeRecord(sequence=sequence, **values)


def get(connection: Connection, episode_id: str) -> EpisodeRecord:
    """The episode without its trajectory; raises NotFoundError."""
    row = connection.execute(select(*_WITHOUT_TRAJECTORY).where(_EPISODES.c.id == episode_id)).first()
    if row is None:
        raise NotFoundError("episode", episode_id)
    return EpisodeRecord(**row._mapping)


def uploaded_with(connection: Connection, key: str) -> EpisodeRecord | None:
    """The episode of the upload with this `Idempotency-Key`, if there is one.

    In a write transaction it waits for another one that stores an episode with the key.
    """
    if writes(connection):
        lock(connection, f"upload {key}")
    id_: str | None = connection.scalar(select(_EPISODES.c.id).where(_EPISODES.c.upload_key == key))
    return None if id_ is None else get(connection, id_)


def list_page(
    connection: Connection, chosen: EpisodeFilter = EVERY, limit: int = 50, cursor: int | None = None
) -> Page[EpisodeRecord]:
    """The episodes that fit, newest first."""
    return fetch_page(connection, _EPISODES, chosen.narrow(select(*LISTED)), limit, cursor, record_of)


def by_ids(connection: Connection, task: str, ids: Sequence[str]) -> dict[str, EpisodeRecord]:
    """Return the episodes that the task still has, by id, in the order of `ids`."""
    query = select(*LISTED).where(_EPISODES.c.id.in_(ids))
    found = {row.id: row for row in connection.execute(query) if row.task == task}
    return {id_: record_of(found[id_]) for id_ in ids if id_ in found}


def corrections_of(connection: Connection, prediction_id: str) -> tuple[str, ...]:
    """The ids of the episodes that correct a prediction, oldest first."""
    query = select(_EPISODES.c.id).where(_EPISODES.c.corrects == prediction_id).order_by(_EPISODES.c.sequence)
    return tuple(connection.scalars(query))


def instructions(connection: Connection, task: str) -> tuple[str, ...]:
    """At most `MAX_INSTRUCTIONS` different instructions of a task's demonstrations."""
    query = select(_EPISODES.c.instruction).where(_EPISODES.c.task == task, _SHOWN).distinct().limit(MAX_INSTRUCTIONS)
    return tuple(sorted(connection.scalars(query)))


def newest_by_task(connection: Connection) -> dict[str, EpisodeRecord]:
    """The newest demonstration of every task that has one."""
    numbers = select(func.max(_EPISODES.c.sequence)).where(_SHOWN)
    newest = numbers.group_by(_EPISODES.c.task)
    query = select(*LISTED).where(_EPISODES.c.sequence.in_(newest))
    return {row.task: record_of(row) for row in connection.execute(query)}


def neighbors(connection: Connection, record: EpisodeRecord) -> tuple[str | None, str | None]:
    """The ids of the next older and the next newer episode of the same task."""
    ids = select(_EPISODES.c.id).where(_EPISODES.c.task == record.task).limit(1)
    number = _EPISODES.c.sequence
    older = connection.scalar(ids.where(number < record.sequence).order_by(number.desc()))
    return older, connection.scalar(ids.where(number > record.sequence).order_by(number))


def all_of(connection: Connection, task: str) -> tuple[EpisodeRecord, ...]:
    """Every episode of a task, oldest first."""
    query = select(*LISTED).where(_EPISODES.c.task == task).order_by(_EPISODES.c.sequence)
    return tuple(record_of(row) for row in connection.execute(query))


def number_of(connection: Connection, task: str, *, left_out: bool | None = None) -> int:
    """How many episodes the task has; only those that are left out of prompts, or are not, where that is asked for."""
    query = select(func.count()).select_from(_EPISODES).where(_EPISODES.c.task == task)
    if left_out is not None:
        query = query.where(_EPISODES.c.left_out.is_(left_out))
    return connection.scalar(query) or 0


def number_unseen(connection: Connection, task: str) -> int:
    """How many episodes of the task have no depth image, by the text of the JSON."""
    has_depth = cast(_EPISODES.c.cameras, Text).contains('"depth_digest":"')
    query = select(func.count()).select_from(_EPISODES).where(_EPISODES.c.task == task, ~has_depth)
    return connection.scalar(query) or 0


def list_ids(connection: Connection, task: str) -> tuple[str, ...]:
    """The ids of a task's demonstrations, oldest first."""
    query = select(_EPISODES.c.id).where(_EPISODES.c.task == task, _SHOWN).order_by(_EPISODES.c.sequence)
    return tuple(connection.scalars(query))


def edit(connection: Connection, record: EpisodeRecord, changes: Mapping[str, Any]) -> EpisodeRecord:
    """The episode with other values of these fields; if prompts may change its task's version grows.

    Raises NotFoundError if the episode was deleted since.
    """
    changed = {name: value for name, value in changes.items() if value != getattr(record, name)}
    if not changed:
        return record
    values = dict(changed)
    if "instruction" in changed:
        first = record.uploaded_instruction or record.instruction
        values["uploaded_instruction"] = None if first == changed["instruction"] else first
    tasks.lock(connection, record.task)
    if connection.execute(update(_EPISODES).where(_EPISODES.c.id == record.id).values(values)).rowcount == 0:
        raise NotFoundError("episode", record.id)
    if changed.keys() != {"note"}:
        tasks.change(connection, record.task, {})
    return replace(record, **values)


def remove(connection: Connection, episode_id: str) -> str:
    """Delete an episode; returns its task, whose version grows, and whose object names go with the last episode.

    Raises NotFoundError.
    """
    task: str | None = connection.scalar(select(_EPISODES.c.task).where(_EPISODES.c.id == episode_id))
    if task is None:
        raise NotFoundError("episode", episode_id)
    tasks.lock(connection, task)  # an upload under way would not be seen below
    if connection.execute(delete(_EPISODES).where(_EPISODES.c.id == episode_id)).rowcount == 0:
        raise NotFoundError("episode", episode_id)
    others_left = connection.scalar(select(exists().where(_EPISODES.c.task == task)))
    tasks.change(connection, task, {} if others_left else {"object_names": None})
    return task


def demonstrations(connection: Connection, task: str, limit: int | None = None) -> tuple[DemonstrationRecord, ...]:
    """The task's first `limit` demonstrations as prompts need them, or all, oldest first.

    Episodes that are left out of prompts are not demonstrations.
    """
    query = select(*_FOR_PROMPTS).where(_EPISODES.c.task == task, _SHOWN).order_by(_EPISODES.c.sequence).limit(limit)
    return tuple(DemonstrationRecord(*row) for row in connection.execute(query))


def scenes(connection: Connection, task: str) -> dict[str, tuple[ObjectRecord, ...]]:
    """The objects of every demonstration of the task at its first frame, oldest first, by id."""
    rows = connection.execute(_SCENES, {"task": task})
    return {row.id: row.objects for row in rows}


def demonstrations_by_id(connection: Connection, task: str, ids: Sequence[str]) -> tuple[DemonstrationRecord, ...]:
    """Return the task's episodes as prompts need them, in the order of `ids`; raises NotFoundError naming one."""
    # The task is compared here: in the statement it would tempt SQLite to walk through the whole task.
    rows = connection.execute(select(_EPISODES.c.task, *_FOR_PROMPTS).where(_EPISODES.c.id.in_(ids)))
    found = {row.id: DemonstrationRecord(*row[1:]) for row in rows if row.task == task}
    for episode_id in ids:
        if episode_id not in found:
            raise NotFoundError(f"episode of task {task!r}", episode_id)
    return tuple(found[episode_id] for episode_id in ids)


def left_out_of(connection: Connection, ids: Sequence[str]) -> set[str]:
    """Return the ids of the episodes that are left out of prompts."""
    query = select(_EPISODES.c.id).where(_EPISODES.c.id.in_(ids), ~_SHOWN)
    return set(connection.scalars(query))


def stale(
    connection: Connection, task: str, keys: ExtractionKeys, ids: Collection[str] | None = None
) -> tuple[EpisodeRecord, ...]:
    """Return the task's episodes that were extracted with other settings than those of `keys`, oldest first.

    Args:
        ids: of the episodes to look at; None: all that are not left out of prompts.
    """
    differs = or_(_EPISODES.c.keyframes_key != keys.keyframes, _EPISODES.c.poses_key != keys.poses)
    which = _SHOWN if ids is None else _EPISODES.c.id.in_(ids)
    query = select(*LISTED).where(_EPISODES.c.task == task, which, differs).order_by(_EPISODES.c.sequence)
    return tuple(map(record_of, connection.execute(query)))


def replace_extractions(connection: Connection, extractions: Sequence[Extraction]) -> None:
    """Put newly extracted keyframes and poses in the place of the old."""
    query = update(_EPISODES).where(_EPISODES.c.id == bindparam("episode_id"))
    rows = [
        {
            "episode_id": item.episode_id,
            "keyframes": item.keyframes,
            "objects": item.objects,
            "keyframes_key": item.keys.keyframes,
            "poses_key": item.keys.poses,
        }
        for item in extractions
    ]
    connection.execute(query, rows)


def record_of(row: Row[Any]) -> EpisodeRecord:
    """The record of a row of `LISTED`, or of more."""
    return EpisodeRecord(**row._mapping)
