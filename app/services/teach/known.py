"""What the store knows of an upload's task: read in one transaction, held against the episode, and at the commit.

An episode may have other objects than its task, if nothing depends on them; and says which object it is about.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from sqlalchemy import Connection

from app.perception.base import ObjectQuery
from app.pipeline.alike import Alike, with_numbers
from app.pipeline.errors import ObjectSetError
from app.pipeline.findings import Finding
from app.pipeline.findings.arrangement import FEWEST
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.scene import other_objects
from app.pipeline.keyframes import Motion
from app.pipeline.order.order import Order
from app.pipeline.order.space import Layout
from app.pipeline.plans import Recording
from app.pipeline.plans.recording import GRASPED_M
from app.pipeline.prompt import check_object_names
from app.services.predict.demonstrations import Demonstrations, recordings_of
from app.services.predict.instruction import is_english
from app.services.task_settings import TaskSettings
from app.services.teach.room import FIRST
from app.store import episodes, tasks
from app.store.records import DemonstrationRecord
from app.store.values import JsonObject
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

MAX_COMPARED = 30  # demonstrations that an upload is held against


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


def saying_which(
    instruction: str, motion: Motion, given: Sequence[ObjectPose], alike: Sequence[Alike], base_m: Array
) -> str:
    """The instruction, with the number of each of several objects of one name that it is about.

    Args:
        given: the objects whose poses came with the recording, those of one name by their numbers.
        base_m: (3,) where the robot stands.

    Raises:
        UngroundedInstructionError: if it is not clear which is meant, or the hand goes to another.
    """
    if not alike:
        return instruction
    layout = Layout({pose.name: pose.position_m for pose in given}, base_m)
    return with_numbers(instruction, layout, _acts_at_m(motion), alike, is_english)


def check_objects(
    task: KnownTask, instruction: str, sent: Sequence[str], given: Sequence[ObjectPose], motion: Motion
) -> tuple[Finding, ...]:
    """Refuse an episode whose objects are not the task's, unless rows follow and words name none that differ.

    Args:
        sent: the names of its objects.
        given: those whose poses came with the recording.

    Raises:
        ObjectSetError: naming what is missing, or what is new and matters to the episode.
    """
    if task.object_names is None:
        return ()
    names = list(task.object_names)
    if task.recordings is None:
        check_object_names(sent, names)
        return ()
    named = frozenset(Order(instruction, tuple(dict.fromkeys((*names, *sent)))).objects)
    taught = Taught(Demonstrations.of(task.recordings).only(names).recorded)
    # Two demonstrations do not tell what rows follow, but what is missing from here on no row can follow.
    many = len(task.recordings) >= FEWEST
    check_object_names(sent, names, named | (taught.needed if many else taught.decisive))
    new = [name for name in sent if name not in names]
    matter = {name for name in new if name in named or _is_acted_on(name, given, motion)}
    if matter:
        raise ObjectSetError("objects", f"not of this task: {', '.join(sorted(matter))}", ", ".join(names))
    return other_objects([name for name in names if name not in sent], new)


def _is_acted_on(name: str, given: Sequence[ObjectPose], motion: Motion) -> bool:
    """Whether the hand acts at an object, or may: where that is, is not known before it is found in images."""
    own_m = next((pose.position_m for pose in given if pose.name == name), None)
    if own_m is None:
        return True
    for acts_m in _acts_at_m(motion):
        off_m = float(np.linalg.norm(own_m - acts_m))
        if off_m <= GRASPED_M and off_m <= min(float(np.linalg.norm(pose.position_m - acts_m)) for pose in given):
            return True
    return False


def _acts_at_m(motion: Motion) -> Array:
    """(K, 3) where the gripper switches; without a switch where the hand is lowest."""
    positions_m = motion.trajectory.positions_m
    frames = [switch.frame for switch in motion.acting_switches] or [int(positions_m[:, 2].argmin())]
    acts: Array = positions_m[frames]
    return acts
