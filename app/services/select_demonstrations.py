"""Which of a task's episodes become the demonstrations of a prompt, in the order in which it shows them."""

import random
from collections.abc import Sequence
from datetime import datetime
from typing import Literal

from sqlalchemy import Connection

from app.pipeline.episode import ObjectPose
from app.pipeline.selection import most_diverse, nearest_last
from app.services.cache import Cache
from app.services.scenes import Scenes, read_scenes
from app.store import episodes
from app.store.records import TaskRecord

Selection = Literal["first", "recent", "random", "nearest", "diverse"]
MAX_TASKS = 64  # whose scenes are kept: 10,000 episodes of three objects take 1 MB
MAX_CHOICES = 1024


# A task that was deleted and made again counts its versions from the beginning.
TaskState = tuple[str, datetime, int]


def _state(task: TaskRecord) -> TaskState:
    return task.name, task.created_at, task.version


class DemonstrationSelector:
    """Selects, and remembers per version of a task what does not depend on the observation."""

    def __init__(self) -> None:
        self._scenes: Cache[TaskState, Scenes] = Cache(MAX_TASKS)
        self._choices: Cache[tuple[TaskState, Selection, int, int], tuple[str, ...]] = Cache(MAX_CHOICES)

    def __call__(
        self,
        connection: Connection,
        task: TaskRecord,
        selection: Selection,
        number: int,
        seed: int,
        objects: Sequence[ObjectPose],
    ) -> tuple[str, ...]:
        """The ids of at most `number` episodes of the task.

        Args:
            selection: `first` and `recent` by time of upload; `random` by `seed`; `nearest` by the distance of the
                observed `objects` to the episode's, the nearest last, where a language model heeds it most; `diverse`
                those whose objects stand farthest apart, oldest first.
        """
        if selection == "nearest":
            scenes = self._scenes_of(connection, task)
            return scenes.ids_at(nearest_last(scenes.positions_m, scenes.observed_m(objects), number))
        key = (_state(task), selection, number, seed if selection == "random" else 0)
        return self._choices.get(key, lambda: self._choose(connection, task, selection, number, seed))

    def _choose(
        self, connection: Connection, task: TaskRecord, selection: Selection, number: int, seed: int
    ) -> tuple[str, ...]:
        if selection == "random":
            ids = episodes.list_ids(connection, task.name)
            return tuple(random.Random(seed).sample(ids, min(number, len(ids))))
        if selection == "diverse":
            scenes = self._scenes_of(connection, task)
            return scenes.ids_at(most_diverse(scenes.positions_m, number))
        order: Literal["first", "recent"] = "recent" if selection == "recent" else "first"
        return tuple(record.id for record in episodes.demonstrations(connection, task.name, number, order))

    def _scenes_of(self, connection: Connection, task: TaskRecord) -> Scenes:
        return self._scenes.get(_state(task), lambda: read_scenes(connection, task.name))
