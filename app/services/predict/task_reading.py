"""A task as one transaction reads it: its settings and demonstrations, and what is made of them once a version."""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from sqlalchemy import Connection

from app.pipeline.findings.demonstrations import Taught
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.predict.demonstrations import (
    Demonstrations,
    hands_of,
    in_all,
    read_compared,
    recordings_of,
    stepwise,
)
from app.services.predict.request import Selection
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import DemonstrationRecord
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

MAX_HELD_AGAINST = 50  # demonstrations of a task

Ids = tuple[str, ...]
Caches = dict[str, Cache[Any, Any]]  # by the name of the method that makes the values
P = ParamSpec("P")
V = TypeVar("V")


def nearest_last(scenes_m: Array, observed_m: Array, number: int) -> list[int]:
    """The indices of the `number` scenes nearest to the observed one, the nearest last.

    Args:
        scenes_m: (N, K, 3) positions of each scene's K objects in meters, world frame.
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

    ids: Ids
    names: tuple[str, ...]
    positions_m: Array

    @classmethod
    def read(cls, connection: Connection, task: str) -> "Scenes":
        """The scenes of the task's episodes, with the objects that all have."""
        stored = episodes.scenes(connection, task)
        names = in_all([[item.name for item in objects] for objects in stored.values()])
        places_m = [{item.name: item.position_m for item in objects} for objects in stored.values()]
        positions_m = np.array([[place[name] for name in names] for place in places_m])
        return cls(tuple(stored), names, positions_m.reshape(len(stored), len(names), 3))

    def nearest_last(self, objects: Sequence[ObjectPose], number: int) -> Ids:
        """The ids of the `number` scenes nearest to these objects, as far as scenes have them, the nearest last."""
        by_name = {pose.name: pose.position_m for pose in objects}
        places = [place for place, name in enumerate(self.names) if name in by_name]
        observed_m = np.array([by_name[self.names[place]] for place in places]).reshape(-1, 3)
        return tuple(self.ids[index] for index in nearest_last(self.positions_m[:, places], observed_m, number))


def kept(
    capacity: int,
) -> Callable[[Callable[Concatenate["TaskReading", P], V]], Callable[Concatenate["TaskReading", P], V]]:
    """For methods whose value depends on the task's version and the arguments alone: it is made once."""

    def keeping(make: Callable[Concatenate["TaskReading", P], V]) -> Callable[Concatenate["TaskReading", P], V]:
        name = make.__name__

        @wraps(make)
        def look_up(self: "TaskReading", /, *args: P.args, **kwargs: P.kwargs) -> V:
            assert not kwargs, "one value would have several keys"
            cache = self.caches.get(name) or self.caches.setdefault(name, Cache(capacity))
            value: V = cache.get_or_make((self.record.state, *args), lambda: make(self, *args, **kwargs))
            return value

        return look_up

    return keeping


class TaskReading:
    """A task in the transaction of `connection`.

    Attributes:
        record: as it is stored.

    Args:
        caches: what was made of tasks; nothing in it depends on an observed scene or on words.

    Raises:
        NotFoundError: if there is no such task.
    """

    def __init__(self, connection: Connection, name: str, caches: Caches) -> None:
        self.record = tasks.get(connection, name)
        self.caches = caches
        self._connection = connection

    @property
    @kept(128)
    def settings(self) -> TaskSettings:
        """Of the task."""
        return TaskSettings.model_validate(self.record.settings)

    def ids(self, selection: Selection, number: int, seed: int, objects: Sequence[ObjectPose]) -> Ids:
        """The ids of at most `number` episodes of the task.

        Args:
            selection: `first` and `recent` by time of upload; `random` by `seed`; `nearest` by the distance of the
                observed `objects` to the episode's, the nearest last, where a language model attends to it most;
                `diverse` those whose objects stand farthest apart, oldest first.
        """
        match selection:
            case "first":
                return self._scenes().ids[:number]
            case "recent":
                return self._scenes().ids[-number:]
            case "random":
                ids = self._scenes().ids
                return tuple(random.Random(seed).sample(ids, min(number, len(ids))))
            case "nearest":
                return self._scenes().nearest_last(objects, number)
            case "diverse":
                return self._diverse(number)

    @kept(1024)
    def _diverse(self, number: int) -> Ids:
        scenes = self._scenes()
        return tuple(scenes.ids[index] for index in most_diverse(scenes.positions_m, number))

    @kept(128)  # 10,000 of three objects take 1 MB
    def _scenes(self) -> Scenes:
        return Scenes.read(self._connection, self.record.name)

    def refuse_left_out(self, ids: Sequence[str]) -> None:
        """Refuse episodes that no prompt is to show.

        Raises:
            InvalidInputError: naming the first.
        """
        left_out = episodes.left_out_of(self._connection, ids)
        for number, id_ in enumerate(ids):
            if id_ in left_out:
                remedy = f'others, or PATCH /episodes/{id_} with {{"left_out": false}}'
                raise InvalidInputError(f"episode_ids[{number}]", f"{id_} is left out of prompts", remedy)

    @kept(64)
    def demonstrations(self, ids: Ids) -> Demonstrations:
        """Of those ids, those of one plan with equally many rows.

        Raises:
            NotFoundError: naming the first id that is no episode of this task.
        """
        recordings = recordings_of(self._connection, self._records(ids), self.settings)
        found = Demonstrations.of(recordings).only(self.record.object_names or ())
        return replace(found, hands=hands_of(recordings, found.recorded)) if ids == self._held_against else found

    @kept(64)
    def stepwise(self, ids: Ids) -> Demonstrations:
        """The same for a closed loop: each with its own keyframes, to which its objects were tracked."""
        own = stepwise(self._records(ids), self.settings)
        return Demonstrations(own, own).only(self.record.object_names or ())

    def _records(self, ids: Ids) -> tuple[DemonstrationRecord, ...]:
        return episodes.demonstrations_by_id(self._connection, self.record.name, ids)

    @property
    def _held_against(self) -> Ids:
        """The ids of the demonstrations that answers are held against."""
        return self._diverse(MAX_HELD_AGAINST)

    @kept(128)
    def taught(self, from_start: bool, closed_loop: bool) -> Taught:
        """All demonstrations of the task, whichever a request names; of very many those that lie farthest apart.

        Those that a program names may be of one way by chance: the service cannot know that a person chose them.

        Args:
            from_start: whether rows may be relative to where the end effector is.

        Raises:
            NoDemonstrationsError: if there is none, or all are left out.
        """
        if not (ids := self._held_against):
            raise NoDemonstrationsError(self.record.name)
        known, settings = self.demonstrations(ids), self.settings
        recorded = known.recorded if from_start else tuple(replace(item, start=None) for item in known.recorded)
        return Taught(
            recorded,
            several_ways=settings.ways == "several",
            hands=known.hands,
            round_objects=frozenset(settings.yaw_symmetry_deg),
            moves=closed_loop,
            compared=read_compared(self._connection, self.record.name, ids, settings),
        )
