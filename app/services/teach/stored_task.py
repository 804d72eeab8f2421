"""The task of an upload: as the store has it before extraction, compared with the episode, and locked for the commit.

An episode may lack objects of its task, or have further ones, where no motion depends on them.
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
from app.pipeline.findings.demonstrated_scenes import MIN_AGREEING
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.scene import other_objects
from app.pipeline.keyframes import Motion
from app.pipeline.names import check_object_names
from app.pipeline.order.order import Order
from app.pipeline.order.space import Layout
from app.pipeline.plans import Recording
from app.pipeline.thresholds import GRASPED_M
from app.services.english import is_english
from app.services.predict.demonstrations import Demonstrations, recordings_of
from app.services.task_settings import TaskSettings
from app.services.teach.workspace import NUM_FIRST
from app.store import episodes, tasks
from app.store.records import DemonstrationRecord
from app.store.values import JsonObject
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

MAX_COMPARED = 30  # demonstrations that an upload is held against


@dataclass(frozen=True, eq=False)
class StoredTask:
    """A task as it was read before an episode is extracted for it.

    Attributes:
        stored: its settings as JSON; of a new task those that it will be created with.
        object_names: in the task's order; None while it has no episode.
        demonstrations: its first `MAX_COMPARED`.
        recordings: of these demonstrations; None unless the episode's objects are partly the task's.
    """

    name: str
    is_new: bool
    stored: JsonObject
    object_names: tuple[str, ...] | None = None
    demonstrations: tuple[DemonstrationRecord, ...] = ()
    recordings: Sequence[Recording] | None = None

    @classmethod
    def read(cls, connection: Connection, name: str, objects: Sequence[ObjectQuery]) -> "StoredTask":
        """Read the task that an episode with these objects is uploaded to."""
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
        """The validated settings."""
        return TaskSettings.model_validate(self.stored)

    @property
    def first(self) -> tuple[DemonstrationRecord, ...]:
        """The demonstrations whose extent bounds how far an upload may widen the workspace."""
        return self.demonstrations[:NUM_FIRST]

    def locked(self, connection: Connection) -> "StoredTask | None":
        """Lock the task and return it as it is now, or None where the episode must be extracted again.

        That is: where the task was deleted, or its objects or a setting that extraction depends on changed. Its
        workspace and first demonstrations may have changed.
        """
        if self.is_new:
            task = tasks.get_or_create(connection, self.name, self.stored)
        elif (found := tasks.find(connection, self.name, lock=True)) is not None:
            task = found
        else:
            return None
        if (task.object_names, _extracting(task.settings)) != (self.object_names, _extracting(self.stored)):
            return None
        shown = episodes.demonstrations(connection, self.name, NUM_FIRST)
        return replace(self, stored=task.settings, demonstrations=shown)


def _extracting(settings: JsonObject) -> JsonObject:
    """Return the settings that extraction depends on: all but the workspace, which uploads widen."""
    return {name: value for name, value in settings.items() if name != "workspace"}


def numbered_instruction(
    instruction: str, motion: Motion, given: Sequence[ObjectPose], alike: Sequence[Alike], base_m: Sequence[float]
) -> str:
    """Return the instruction in which objects of one name have their numbers ("the bowl" -> "the bowl 2").

    Args:
        given: the objects whose poses came with the recording, those of one name already numbered.
        base_m: (3,) position of the robot's base in meters, world frame.

    Raises:
        UngroundedInstructionError: if it is not clear which object is meant, or the hand goes to another one.
    """
    if not alike:
        return instruction
    layout = Layout({pose.name: pose.position_m for pose in given}, np.array(base_m))
    return with_numbers(instruction, layout, _acts_at_m(motion), alike, is_english)


def check_objects(
    task: StoredTask, instruction: str, sent: Sequence[str], given: Sequence[ObjectPose], motion: Motion
) -> tuple[Finding, ...]:
    """Refuse an episode whose objects differ from the task's where the difference matters; report it otherwise.

    An object matters if prompts have rows relative to it, the instruction names it, or the hand acts on it.

    Args:
        sent: names of the episode's objects.
        given: those of them whose poses came with the recording.

    Raises:
        ObjectSetError: naming the missing objects, or the new ones that matter.
    """
    if task.object_names is None:
        return ()
    names = list(task.object_names)
    if task.recordings is None:
        check_object_names(sent, names)
        return ()
    named = frozenset(Order(instruction, tuple(dict.fromkeys((*names, *sent)))).objects)
    taught = Taught(Demonstrations.of(task.recordings).only(names).recorded)
    # Two demonstrations do not show which objects rows follow; but no row can follow an object that an episode lacks.
    many = len(task.recordings) >= MIN_AGREEING
    check_object_names(sent, names, named | (taught.needed if many else taught.decisive))
    new = [name for name in sent if name not in names]
    matter = {name for name in new if name in named or _is_acted_on(name, given, motion)}
    if matter:
        raise ObjectSetError("objects", f"not of this task: {', '.join(sorted(matter))}", ", ".join(names))
    return other_objects([name for name in names if name not in sent], new)


def _is_acted_on(name: str, given: Sequence[ObjectPose], motion: Motion) -> bool:
    """Return whether the hand grasps, releases or touches the object; True if its pose is not known yet."""
    own_m = next((pose.position_m for pose in given if pose.name == name), None)
    if own_m is None:
        return True
    for acts_m in _acts_at_m(motion):
        off_m = float(np.linalg.norm(own_m - acts_m))
        if off_m <= GRASPED_M and off_m <= min(float(np.linalg.norm(pose.position_m - acts_m)) for pose in given):
            return True
    return False


def _acts_at_m(motion: Motion) -> Array:
    """Return (K, 3) positions of the hand where the gripper switches; without a switch, its lowest position."""
    positions_m = motion.trajectory.positions_m
    frames = [switch.frame for switch in motion.acting_switches] or [int(positions_m[:, 2].argmin())]
    acts: Array = positions_m[frames]
    return acts
