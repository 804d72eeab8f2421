"""Keyframes and object poses of episodes. What is stored carries the keys of the settings that it was extracted with.

A task's settings may change at any time. Who reads its episodes reads them in a `reading`: an episode that was
extracted with other settings is first extracted again, from its stored recording.
"""

from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import groupby
from operator import attrgetter
from typing import NamedTuple

from sqlalchemy import Connection

from app.perception.base import GIVEN, ObjectQuery
from app.pipeline.keyframes import Motion, find_keyframes
from app.services.images import read_frame
from app.services.poses import poses_of
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.blobs import BlobStore
from app.store.errors import ConflictError, NotFoundError
from app.store.records import EpisodeRecord, Extraction, TaskRecord, TaskState
from app.store.store import Store
from app.store.trajectories import get_trajectory
from app.store.values import KeyframeRecord, ObjectRecord
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import RgbdFrame

MAX_ATTEMPTS = 3  # settings may change while episodes are extracted


class Reading(NamedTuple):
    """A read transaction in which a task's demonstrations are as its settings want them.

    Attributes:
        refused: by episode why it cannot be extracted with the settings; it is as it was extracted last.
    """

    connection: Connection
    task: TaskRecord
    refused: Mapping[str, InvalidInputError]


@contextmanager
def reading(
    store: Store,
    name: str,
    ids: Collection[str] | None = None,
    *,
    fresh: Container[TaskState] = (),
    strict: bool = True,
) -> Iterator[Reading]:
    """Read a task's demonstrations, those extracted with other settings extracted again before.

    Args:
        ids: of the episodes that are read; None: all that are not left out of prompts.
        fresh: states of tasks in which none needs it.
        strict: refuse an episode that cannot be extracted.

    Raises:
        NotFoundError: if there is no such task.
        InvalidInputError: naming the episode that cannot be extracted with the settings, and why.
        CorruptDataError, StoreUnavailableError: if its recording cannot be read.
        ConflictError: if the settings keep changing.
    """
    refused: dict[str, InvalidInputError] = {}
    for _ in range(MAX_ATTEMPTS):
        with store.read() as connection:
            task = tasks.get(connection, name)
            stale = () if task.state in fresh else _stale(connection, task, ids)
            if refused.keys() >= {record.id for record in stale}:
                yield Reading(connection, task, refused)
                return
        refused = _extract_again(store, task, stale)
        if strict and refused:
            raise next(iter(refused.values()))
    raise ConflictError(f"task {name!r} kept changing: send the request again")


def read_episode(store: Store, episode_id: str, *, strict: bool = False) -> tuple[EpisodeRecord, TaskSettings]:
    """Return an episode as the settings of its task want it, and these.

    Args:
        strict: refuse one that cannot be extracted so, unless it is left out of prompts; else it is as it was last.

    Raises:
        NotFoundError: if there is no such episode; as `reading`.
    """
    with store.read() as connection:
        record = episodes.get(connection, episode_id)
    with reading(store, record.task, [episode_id], strict=strict and not record.left_out) as now:
        return episodes.get(now.connection, episode_id), TaskSettings.read(now.connection, now.task)


def read_episodes(store: Store, records: Sequence[EpisodeRecord]) -> list[tuple[EpisodeRecord, TaskSettings]]:
    """As `read_episode`, several, without those that were deleted since."""
    found: dict[str, tuple[EpisodeRecord, TaskSettings]] = {}
    for name, of_task in groupby(sorted(records, key=attrgetter("task")), attrgetter("task")):
        ids = [record.id for record in of_task]
        with suppress(NotFoundError), reading(store, name, ids, strict=False) as now:
            settings = TaskSettings.read(now.connection, now.task)
            found |= {id_: (record, settings) for id_, record in episodes.by_ids(now.connection, name, ids).items()}
    return [found[record.id] for record in records if record.id in found]


def _stale(connection: Connection, task: TaskRecord, ids: Collection[str] | None) -> tuple[EpisodeRecord, ...]:
    keys = TaskSettings.model_validate(task.settings).extraction_keys
    return episodes.stale(connection, task.name, keys, ids)


def _extract_again(store: Store, task: TaskRecord, records: Sequence[EpisodeRecord]) -> dict[str, InvalidInputError]:
    """Store what the task's settings make of these episodes; return by episode why it cannot be extracted."""
    settings = TaskSettings.model_validate(task.settings)
    extractions, refused = [], {}
    for record in records:
        try:
            extractions.append(extract_again(store, record, settings))
        except InvalidInputError as error:
            refused[record.id] = error
        except NotFoundError:  # deleted since
            continue
    if extractions:
        with store.write() as connection:
            now = TaskSettings.model_validate(tasks.lock(connection, task.name).settings)
            if now.extraction_keys == settings.extraction_keys:  # else what newer settings made of it must stay
                episodes.replace_extractions(connection, extractions)
    return refused


def extract_again(store: Store, record: EpisodeRecord, settings: TaskSettings) -> Extraction:
    """A stored episode's keyframes and poses as `settings` want them; those extracted with the same keys stay.

    Raises:
        InvalidInputError: naming the episode and why it cannot be extracted so.
        CorruptDataError: if what is stored of it is damaged.
        NotFoundError: if it was deleted since.
    """
    keys, keyframes, objects = settings.extraction_keys, record.keyframes, record.objects
    try:
        if record.keyframes_key != keys.keyframes:
            with store.read() as connection:
                trajectory = get_trajectory(connection, record.id)
            keyframes = keyframes_of(settings.motion_of(trajectory, record.control_frequency_hz), settings)
        if record.poses_key != keys.poses:
            objects = _poses_again(store.blobs, record, settings)
    except InvalidInputError as error:
        raise InvalidInputError(f"episode {record.id}: {error.field}", error.message, error.valid) from error
    return Extraction(record.id, keyframes, objects, keys)


def _poses_again(blobs: BlobStore, record: EpisodeRecord, settings: TaskSettings) -> tuple[ObjectRecord, ...]:
    given, names = map(ObjectQuery.from_json, record.given_objects), [item.name for item in record.objects]
    looks = settings.pose_estimator != GIVEN or not settings.object_models.keys().isdisjoint(names)
    frames = [read_frame(blobs, item) for item in record.cameras] if looks else []
    return objects_of(given, frames, settings, names, blobs)


def keyframes_of(motion: Motion, settings: TaskSettings) -> tuple[KeyframeRecord, ...]:
    """Return the keyframes of a recording.

    Args:
        motion: as the settings read it.

    Raises:
        InvalidInputError: if there is none.
    """
    rule, trajectory = settings.keyframes.keyframe_rule(), motion.trajectory
    found = find_keyframes(motion, rule)
    if not found:
        message = f"no keyframe in {len(trajectory)} frames by rule {rule.rule!r}"
        raise InvalidInputError("trajectory", message, "an episode in which the robot moves and then rests")
    return tuple(KeyframeRecord.of(k, trajectory.action_at(k, gripper_open=is_open)) for k, is_open in found)


def objects_of(
    objects: Iterable[ObjectQuery],
    frames: Sequence[RgbdFrame],
    settings: TaskSettings,
    names: Sequence[str],
    blobs: BlobStore,
) -> tuple[ObjectRecord, ...]:
    """Return the objects' poses at the first frame in the task's order.

    Args:
        names: of the objects, in the task's order.
        blobs: where templates of the objects are.

    Raises:
        InvalidInputError: if an object cannot be found.
    """
    has_rgbd = any(frame.rgb is not None and frame.depth_m is not None for frame in frames)
    poses = poses_of(objects, settings, frames, blobs, given_first=not has_rgbd)
    return tuple(map(ObjectRecord.of, sorted(poses, key=lambda pose: names.index(pose.name))))
