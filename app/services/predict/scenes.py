"""The scenes of a task's demonstrations, among which those for a prompt are selected."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from sqlalchemy import Connection

from app.services.predict.request import PredictOptions
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
    _diverse: dict[int, Ids] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def read(cls, connection: Connection, task: str) -> "Scenes":
        stored = episodes.scenes(connection, task)
        names = in_all([[item.name for item in objects] for objects in stored.values()])
        places_m = [{item.name: item.position_m for item in objects} for objects in stored.values()]
        positions_m = np.array([[place[name] for name in names] for place in places_m])
        return cls(tuple(stored), names, positions_m.reshape(len(stored), len(names), 3))

    def selected(self, options: PredictOptions, number: int, objects: Sequence[ObjectPose]) -> Ids:
        """Return the ids of the `number` scenes that the options select.

        Args:
            objects: as observed, for the selection `nearest`; it puts the nearest last, where a language model attends
                to it most.
        """
        match options.selection:
            case "first":
                return self.ids[:number]
            case "recent":
                return self.ids[-number:]
            case "random":
                return tuple(random.Random(options.seed).sample(self.ids, min(number, len(self.ids))))
            case "nearest":
                return self.nearest_last(objects, number)

    def nearest_last(self, objects: Sequence[ObjectPose], number: int) -> Ids:
        """Return the ids of the `number` scenes whose objects are nearest to these, the nearest last."""
        by_name = {pose.name: pose.position_m for pose in objects}
        places = [place for place, name in enumerate(self.names) if name in by_name]
        observed_m = np.array([by_name[self.names[place]] for place in places]).reshape(-1, 3)
        distances_m = np.linalg.norm(self.positions_m[:, places] - observed_m, axis=2).sum(axis=1)
        return tuple(self.ids[index] for index in np.argsort(distances_m, kind="stable")[:number][::-1])

    def most_diverse(self, number: int) -> Ids:
        """Return the ids of `number` scenes that lie far apart, oldest first; computed once.

        Farthest-point sampling (Gonzalez 1985, "Clustering to minimize the maximum intercluster distance"): begins with
        the first scene, then takes again and again the one that is farthest from all that were taken.
        """
        if number in self._diverse:
            return self._diverse[number]
        chosen: list[int] = []
        gaps_m = np.full(len(self.ids), np.inf)
        for _ in range(min(number, len(self.ids))):
            farthest = int(np.argmax(gaps_m))
            chosen.append(farthest)
            to_it_m = np.linalg.norm(self.positions_m - self.positions_m[farthest], axis=2).sum(axis=1)
            gaps_m = np.minimum(gaps_m, to_it_m)
            gaps_m[chosen] = -1.0  # of several scenes that are the same each is taken once
        self._diverse[number] = tuple(self.ids[index] for index in sorted(chosen))
        return self._diverse[number]


def in_all(names: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the names that all scenes have, in the first scene's order."""
    return tuple(name for name in names[0] if all(name in others for others in names)) if names else ()
