"""The scenes of a task's demonstrations, among which those for a prompt are selected."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sqlalchemy import Connection

from app.store import episodes
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

Ids = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Scenes:
    """The scenes of one version of a task, oldest first.

    Attributes:
        ids: of the N episodes.
        names: of the K objects that all have.
        positions_m: (N, K, 3) in the world frame.
    """

    ids: Ids
    names: tuple[str, ...]
    positions_m: Array

    @classmethod
    def read(cls, connection: Connection, task: str) -> "Scenes":
        stored = episodes.scenes(connection, task)
        names = in_all([[item.name for item in objects] for objects in stored.values()])
        places_m = [{item.name: item.position_m for item in objects} for objects in stored.values()]
        positions_m = np.array([[place[name] for name in names] for place in places_m])
        return cls(tuple(stored), names, positions_m.reshape(len(stored), len(names), 3))

    def nearest_last(self, objects: Sequence[ObjectPose], number: int) -> Ids:
        """Return the ids of the `number` scenes whose objects are nearest to these, the nearest last."""
        by_name = {pose.name: pose.position_m for pose in objects}
        places = [place for place, name in enumerate(self.names) if name in by_name]
        observed_m = np.array([by_name[self.names[place]] for place in places]).reshape(-1, 3)
        distances_m = np.linalg.norm(self.positions_m[:, places] - observed_m, axis=2).sum(axis=1)
        return tuple(self.ids[index] for index in np.argsort(distances_m, kind="stable")[:number][::-1])

    def most_diverse(self, number: int) -> Ids:
        """Return the ids of `number` scenes that lie far apart, oldest first.

        Farthest-point sampling (Gonzalez 1985, "Clustering to minimize the maximum intercluster distance"): begins with
        the first scene, then takes again and again the one that is farthest from all that were taken.
        """
        chosen: list[int] = []
        gaps_m = np.full(len(self.ids), np.inf)
        for _ in range(min(number, len(self.ids))):
            farthest = int(np.argmax(gaps_m))
            chosen.append(farthest)
            to_it_m = np.linalg.norm(self.positions_m - self.positions_m[farthest], axis=2).sum(axis=1)
            gaps_m = np.minimum(gaps_m, to_it_m)
            gaps_m[chosen] = -1.0  # of several scenes that are the same each is taken once
        return tuple(self.ids[index] for index in sorted(chosen))


def in_all(names: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the names that all scenes have, in the first scene's order."""
    return tuple(name for name in names[0] if all(name in others for others in names)) if names else ()
