"""Which of a task's episodes become the demonstrations of a prompt."""

import random
from collections.abc import Sequence
from typing import Literal

import numpy as np
from sqlalchemy import Connection

from app.pipeline.episode import ObjectPose
from app.store import episodes
from app.store.records import DemonstrationRecord

Selection = Literal["first", "recent", "random", "nearest"]


def load_demonstrations(
    connection: Connection,
    task: str,
    selection: Selection,
    number: int,
    seed: int,
    objects: Sequence[ObjectPose],
) -> tuple[DemonstrationRecord, ...]:
    """At most `number` episodes of the task, in the order in which the prompt shows them.

    Args:
        selection: `first` and `recent` by time of upload; `random` by `seed`; `nearest` by the distance of the observed
            `objects` to the episode's, the nearest last, where a language model heeds it most.
    """
    if selection == "random":
        ids = episodes.list_ids(connection, task)
        chosen = random.Random(seed).sample(ids, min(number, len(ids)))
        return episodes.demonstrations_by_id(connection, task, chosen)
    if selection == "nearest":
        everything = episodes.demonstrations(connection, task)
        return tuple(sorted(everything, key=lambda d: _distance_m(d, objects), reverse=True)[-number:])
    return episodes.demonstrations(connection, task, number, selection)


def _distance_m(record: DemonstrationRecord, objects: Sequence[ObjectPose]) -> float:
    """The sum of the distances between the observed objects and the demonstration's."""
    stored = {item.name: item.position_m for item in record.objects}
    return sum(float(np.linalg.norm(pose.position_m - stored[pose.name])) for pose in objects)
