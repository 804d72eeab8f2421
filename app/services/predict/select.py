"""Which of a task's episodes a prompt shows: the choice may depend on where their objects stand."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sqlalchemy import Connection

from app.store import episodes
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import ObjectPose


def nearest_last(scenes_m: Array, observed_m: Array, number: int) -> list[int]:
    """The indices of the `number` scenes nearest to the observed one, the nearest last.

    Args:
        scenes_m: (N, K, 3) positions of each scene's K objects in metres, world frame.
        observed_m: (K, 3) the same of the observed scene.
    """
    distances_m = np.linalg.norm(scenes_m - observed_m, axis=2).sum(axis=1)
    nearest = np.argsort(distances_m, kind="stable")[:number]
    return [int(index) for index in nearest[::-1]]


def most_diverse(scenes_m: Array, number: int) -> list[int]:
    """The indices of `number` scenes that lie far apart, in ascending order.

    Farthest-point sampling (Gonzalez 1985, "Clustering to minimize the maximum intercluster distance"): begins with
    the first scene, then takes again and again the one that is farthest from all that were taken.

    Args:
        scenes_m: as for `nearest_last`.
    """
    number = min(number, len(scenes_m))
    chosen: list[int] = []
    gaps_m = np.full(len(scenes_m), np.inf)
    for _ in range(number):
        farthest = int(np.argmax(gaps_m))
        chosen.append(farthest)
        to_it_m = np.linalg.norm(scenes_m - scenes_m[farthest], axis=2).sum(axis=1)
        gaps_m = np.minimum(gaps_m, to_it_m)
        gaps_m[chosen] = -1.0  # of several scenes that are the same each is taken once
    return sorted(chosen)


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

    def nearest_last(self, objects: Sequence[ObjectPose], number: int) -> tuple[str, ...]:
        """The ids of the `number` scenes nearest to these objects, as far as scenes have them, the nearest last."""
        by_name = {pose.name: pose.position_m for pose in objects}
        places = [place for place, name in enumerate(self.names) if name in by_name]
        observed_m = np.array([by_name[self.names[place]] for place in places])
        return tuple(self.ids[index] for index in nearest_last(self.positions_m[:, places], observed_m, number))

    def most_diverse(self, number: int) -> tuple[str, ...]:
        """The ids of `number` scenes that lie far apart, oldest first."""
        return tuple(self.ids[index] for index in most_diverse(self.positions_m, number))


def read_scenes(connection: Connection, task: str) -> Scenes:
    """The scenes of the task's episodes, with the objects that all have."""
    stored = episodes.scenes(connection, task)
    names = in_all([[item.name for item in objects] for objects in stored.values()])
    places_m = [{item.name: item.position_m for item in objects} for objects in stored.values()]
    positions_m = np.array([[place[name] for name in names] for place in places_m]).reshape(len(stored), len(names), 3)
    return Scenes(tuple(stored), names, positions_m)


def in_all(names: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Those of the first scene's names that all scenes have."""
    return tuple(name for name in names[0] if all(name in others for others in names)) if names else ()
