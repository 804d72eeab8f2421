"""Which objects an upload may have, those of its task and others that nothing depends on, and which it is about."""

from collections.abc import Sequence

import numpy as np

from app.pipeline.alike import Alike, with_numbers
from app.pipeline.errors import ObjectSetError
from app.pipeline.findings import Finding
from app.pipeline.findings.arrangement import FEWEST
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.scene import other_objects
from app.pipeline.keyframes import Motion
from app.pipeline.order.order import Order
from app.pipeline.order.space import Layout
from app.pipeline.plans.alignment import GRASPED_M
from app.pipeline.prompt import check_object_names
from app.services.predict.demonstrations import Demonstrations
from app.services.predict.instruction import is_english
from app.services.teach.known import KnownTask
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import ObjectPose


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
