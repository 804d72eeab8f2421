"""Which objects an upload may have, those of its task and others that nothing depends on, and which it is about."""

from collections.abc import Sequence

import numpy as np

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
from app.pipeline.plans.recording import GRASPED_M
from app.pipeline.prompt import check_object_names
from app.services.predict.demonstrations import Demonstrations, recordings_of
from app.services.predict.instruction import is_english
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import TaskRecord
from app.store.store import Store
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import ObjectPose

MAX_LOOKED_AT = 50  # demonstrations that say what a scene must have


def check_objects(
    store: Store,
    task: TaskRecord,
    settings: TaskSettings,
    instruction: str,
    objects: Sequence[ObjectQuery],
    motion: Motion,
) -> tuple[Finding, ...]:
    """Refuse an episode whose objects are not the task's, unless rows follow and words name none that differ.

    Raises:
        ObjectSetError: naming what is missing, or what is new and matters to the episode.
    """
    names, sent = list(task.object_names or ()), [query.name for query in objects]
    if set(names) == set(sent) or set(names).isdisjoint(sent):
        check_object_names(sent, names)
        return ()
    named = frozenset(Order(instruction, tuple(dict.fromkeys((*names, *sent)))).objects)
    with store.read() as connection:
        first = episodes.demonstrations(connection, task.name, MAX_LOOKED_AT)
        shown = Demonstrations.of(recordings_of(connection, first, settings))
    taught = Taught(shown.only(names).recorded)
    # Two demonstrations do not tell what rows follow, but what is missing from here on no row can follow.
    check_object_names(sent, names, named | (taught.needed if len(first) >= FEWEST else taught.decisive))
    new = [query for query in objects if query.name not in names]
    matter = {query.name for query in new if query.name in named or _is_acted_on(query, objects, motion)}
    if matter:
        raise ObjectSetError("objects", f"not of this task: {', '.join(sorted(matter))}", ", ".join(names))
    return other_objects([name for name in names if name not in sent], [query.name for query in new])


def saying_which(
    instruction: str, motion: Motion, poses: Sequence[ObjectPose], alike: Sequence[Alike], base_m: Array
) -> str:
    """The instruction, with the number of each of several objects of one name that it is about.

    Args:
        poses: of all objects, by their numbers.
        base_m: (3,) where the robot stands.

    Raises:
        UngroundedInstructionError: if it is not clear which is meant, or the hand goes to another.
    """
    layout = Layout({pose.name: pose.position_m for pose in poses}, base_m)
    return with_numbers(instruction, layout, _acts_at_m(motion), alike, is_english)


def _is_acted_on(query: ObjectQuery, objects: Sequence[ObjectQuery], motion: Motion) -> bool:
    """Whether the hand acts at an object, or may: where that is, is not known before it is found in images."""
    if query.position_m is None:
        return True
    places_m = [np.array(other.position_m) for other in objects if other.position_m is not None]
    own_m = np.array(query.position_m)
    for acts_m in _acts_at_m(motion):
        off_m = float(np.linalg.norm(own_m - acts_m))
        if off_m <= GRASPED_M and off_m <= min(float(np.linalg.norm(place_m - acts_m)) for place_m in places_m):
            return True
    return False


def _acts_at_m(motion: Motion) -> Array:
    """(K, 3) where the gripper switches; without a switch where the hand is lowest."""
    positions_m = motion.trajectory.positions_m
    frames = [switch.frame for switch in motion.acting_switches] or [int(positions_m[:, 2].argmin())]
    acts: Array = positions_m[frames]
    return acts
