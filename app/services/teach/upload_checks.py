"""An upload and the task that it is for: as the store has it, compared with the episode, and locked for the commit.

An episode may lack objects of its task, or have further ones, where no motion depends on them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from sqlalchemy import Connection

from app.perception.base import GivenPoses, ObjectQuery
from app.perception.images import ImageBytes
from app.pipeline.episode import Episode
from app.pipeline.errors import ObjectSetError
from app.pipeline.inputs import check_recording
from app.pipeline.keyframes import Motion
from app.pipeline.names import check_object_names
from app.pipeline.order.frames import frames_of
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.order import Order
from app.pipeline.skill.scene import GRASPED_M
from app.pipeline.skill.skills import Skills
from app.services.extract import reading
from app.services.predict.demonstrations import skills_of
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.errors import NotFoundError
from app.store.records import TaskRecord
from app.store.store import Store
from app.store.values import JsonObject
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera
from roboprompt_client.types.names import checked_instruction, checked_name
from roboprompt_client.types.poses import ObjectPose

MAX_COMPARED = 30  # demonstrations that an upload is compared with


@dataclass(frozen=True, eq=False)
class Upload:
    """An episode with all that came with it.

    Attributes:
        images: per camera of `episode.frames`, by name.
        prediction_id, corrects, left_out, note, uploaded_instruction: see `EpisodeRecord`.
        digest: of the request's content; a repeated `idempotency_key` must come with the same.
    """

    task: str
    episode: Episode
    objects: tuple[ObjectQuery, ...]
    images: Mapping[str, ImageBytes]
    digest: str = ""
    idempotency_key: str | None = None
    prediction_id: str | None = None
    corrects: str | None = None
    left_out: bool = False
    note: str = ""
    uploaded_instruction: str | None = None

    def __post_init__(self) -> None:
        checked_name("task", self.task)
        if self.uploaded_instruction is not None:
            checked_instruction("uploaded_instruction", self.uploaded_instruction)
        if not self.objects:
            raise InvalidInputError("objects", "is empty", "at least one object with its name and pose or mask_ids")
        check_object_names(self.object_names, list(dict.fromkeys(self.object_names)))
        tracked = self.episode.trajectory.num_objects
        if tracked not in (0, len(self.objects)):
            message = f"has {tracked} objects, but objects has {len(self.objects)}"
            raise InvalidInputError("trajectory.object_positions", message, "(T, N, 3), in the order of objects")

    @property
    def object_names(self) -> tuple[str, ...]:
        """In the order of the trajectory's tracks."""
        return tuple(query.name for query in self.objects)

    @property
    def cameras(self) -> tuple[Camera, ...]:
        return tuple(frame.camera for frame in self.episode.frames)


@dataclass(frozen=True, eq=False)
class StoredTask:
    """A task as it was read before an episode is extracted for it.

    Attributes:
        stored: its settings as JSON; of a new task those that it will be created with.
        settings: the same, validated.
        object_names: in the task's order; None while it has no episode.
        skills: of its first `MAX_COMPARED` demonstrations; None unless the episode's objects are partly the task's.
    """

    name: str
    is_new: bool
    stored: JsonObject
    settings: TaskSettings
    object_names: tuple[str, ...] | None = None
    skills: Skills | None = None

    @classmethod
    def read(cls, store: Store, upload: Upload) -> "StoredTask":
        try:
            with reading(store, upload.task, strict=False) as now:
                return cls._read(now.connection, now.task, upload)
        except NotFoundError:
            by_masks = all(query.position_m is None and query.mask_ids for query in upload.objects)
            settings = TaskSettings(pose_estimator="masks" if by_masks else "given")
            return cls(upload.task, True, settings.stored(), settings)

    @classmethod
    def _read(cls, connection: Connection, task: TaskRecord, upload: Upload) -> "StoredTask":
        settings = TaskSettings.read(connection, task)
        own, sent = set(task.object_names or ()), set(upload.object_names)
        partly = own != sent and not own.isdisjoint(sent)
        shown = episodes.demonstrations(connection, task.name, MAX_COMPARED) if partly else ()
        skills = skills_of(connection, shown, settings, own) if shown else None
        return cls(task.name, False, task.settings, settings, task.object_names, skills)

    def is_unchanged(self, connection: Connection) -> bool:
        """Lock the task, created if it is new; return whether its settings and objects are still as they were read."""
        task: TaskRecord | None
        if self.is_new:
            task = tasks.get_or_create(connection, self.name, self.stored)
        else:
            task = tasks.find(connection, self.name, lock=True)
        return task is not None and (task.settings, task.object_names) == (self.stored, self.object_names)


@dataclass(frozen=True, eq=False)
class CheckedUpload:
    """An upload that fits its task.

    Attributes:
        settings: of the task, with the number of the arm's joints.
        motion: of the recording, as the settings read it.
        names: of the objects of the task and of the upload, in the task's order.
    """

    settings: TaskSettings
    motion: Motion
    names: tuple[str, ...]


def checked_upload(upload: Upload, task: StoredTask) -> CheckedUpload:
    """Return the upload as its task's settings read it.

    Raises:
        InvalidInputError: for another arm, or wrong units.
        ObjectSetError: if the objects do not fit the task.
        UngroundedInstructionError: if the instruction is too involved to be read.
    """
    episode = upload.episode
    settings, motion = task.settings.with_recording(episode.trajectory, episode.control_frequency_hz)
    given = GivenPoses().estimate([query for query in upload.objects if query.position_m is not None], ())
    check_recording(motion, given, upload.cameras)
    _check_objects(task, episode.instruction, upload.object_names, given, _acts_at_m(motion))
    names = tuple(dict.fromkeys((*(task.object_names or ()), *upload.object_names)))
    settings.check_models(names)
    frames_of(episode.instruction, Lexicon(names, settings.aliases, [episode.instruction]))
    return CheckedUpload(settings, motion, names)


def _check_objects(
    task: StoredTask, instruction: str, sent: Sequence[str], given: Sequence[ObjectPose], acts_m: Array
) -> None:
    """Refuse an episode whose objects differ from the task's where the difference matters.

    An object matters if prompts have rows relative to it, the instruction names it, or the hand acts on it.

    Args:
        sent: names of the episode's objects.
        given: those of them whose poses came with the recording.
        acts_m: (K, 3), where the hand acts.

    Raises:
        ObjectSetError: naming the missing objects, or the new ones that matter.
    """
    if task.object_names is None:
        return
    names = list(task.object_names)
    if task.skills is None:
        check_object_names(sent, names)
        return
    named = frozenset(Order(instruction, tuple(dict.fromkeys((*names, *sent)))).objects)
    check_object_names(sent, names, named | task.skills.needed)
    new = [name for name in sent if name not in names]
    matter = {name for name in new if name in named or _is_acted_on(name, given, acts_m)}
    if matter:
        raise ObjectSetError("objects", f"not of this task: {', '.join(sorted(matter))}", ", ".join(names))


def _is_acted_on(name: str, given: Sequence[ObjectPose], acts_m: Array) -> bool:
    """Return whether the hand grasps, releases or touches the object; True if its pose is not known yet."""
    off_m = {pose.name: np.linalg.norm(acts_m - pose.position_m, axis=1) for pose in given}
    if name not in off_m:
        return True
    nearest_m = np.min(list(off_m.values()), axis=0)
    return bool(((off_m[name] <= GRASPED_M) & (off_m[name] <= nearest_m)).any())


def _acts_at_m(motion: Motion) -> Array:
    """Return (K, 3) positions of the hand where the gripper switches; without a switch, its lowest position."""
    positions_m = motion.trajectory.positions_m
    frames = [switch.frame for switch in motion.acting_switches] or [int(positions_m[:, 2].argmin())]
    acts: Array = positions_m[frames]
    return acts
