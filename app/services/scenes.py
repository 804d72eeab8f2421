"""Where the objects of a task's episodes stand."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from sqlalchemy import Connection

from app.pipeline.arrays import Array
from app.pipeline.episode import ObjectPose
from app.store import episodes


@dataclass(frozen=True, eq=False)
class Scenes:
    """The scenes of one version of a task, oldest first.

    Attributes:
        ids: of the N episodes.
        names: of the K objects.
        positions_m: (N, K, 3) in the world frame.
    """

    ids: tuple[str, ...]
    names: tuple[str, ...]
    positions_m: Array

    def observed_m(self, objects: Sequence[ObjectPose]) -> Array:
        """(K, 3) the positions of observed objects in the order of `names`."""
        by_name = {pose.name: pose.position_m for pose in objects}
        return np.array([by_name[name] for name in self.names])

    def ids_at(self, indices: Iterable[int]) -> tuple[str, ...]:
        """The episodes' ids."""
        return tuple(self.ids[index] for index in indices)


def read_scenes(connection: Connection, task: str) -> Scenes:
    """The scenes of the task's episodes."""
    stored = episodes.scenes(connection, task)
    names = tuple(item.name for item in stored[0].objects) if stored else ()
    places_m = [{item.name: item.position_m for item in scene.objects} for scene in stored]
    positions_m = np.array([[place[name] for name in names] for place in places_m]).reshape(-1, len(names), 3)
    return Scenes(tuple(scene.id for scene in stored), names, positions_m)
