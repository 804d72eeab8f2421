"""Which of a task's episodes a prompt shows, in which order, and what it shows of them.

Stored episodes become demonstrations with the task's symmetries, and plans whose rows agree. The choice may depend on
where the objects of the episodes stand.
"""

import random
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

import numpy as np
from sqlalchemy import Connection

from app.perception.base import ObjectQuery
from app.pipeline.episode import Demonstration
from app.pipeline.findings.hand import RecordedHand
from app.pipeline.findings.missed import kept
from app.pipeline.findings.sources import Compared
from app.pipeline.plans import Recording, agreeing, aligned_by_plan, shown_together
from app.services.cache import Cache
from app.services.predict.request import Selection
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import DemonstrationRecord, TaskRecord
from app.store.trajectories import get_trajectories
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import ObjectPose, Trajectory

MAX_TASKS = 64  # whose scenes are kept: 10,000 episodes of three objects take 1 MB
MAX_CHOICES = 1024


# A task that was deleted and made again counts its versions from the beginning.
TaskState = tuple[str, datetime, int]


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

    def with_objects(self, objects: Sequence[ObjectPose]) -> tuple[Array, Array]:
        """(N, K, 3) the positions of those objects that were observed, and (K, 3) as they were observed."""
        by_name = {pose.name: pose.position_m for pose in objects}
        places = [place for place, name in enumerate(self.names) if name in by_name]
        return self.positions_m[:, places], np.array([by_name[self.names[place]] for place in places])

    def ids_at(self, indices: Iterable[int]) -> tuple[str, ...]:
        """The episodes' ids."""
        return tuple(self.ids[index] for index in indices)


def read_scenes(connection: Connection, task: str) -> Scenes:
    """The scenes of the task's episodes, with the objects that all have."""
    stored = episodes.scenes(connection, task)
    names = in_all([[item.name for item in scene.objects] for scene in stored])
    places_m = [{item.name: item.position_m for item in scene.objects} for scene in stored]
    positions_m = np.array([[place[name] for name in names] for place in places_m]).reshape(len(stored), len(names), 3)
    return Scenes(tuple(scene.id for scene in stored), names, positions_m)


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
            return scenes.ids_at(nearest_last(*scenes.with_objects(objects), number))
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


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """The demonstrations of one prompt.

    Attributes:
        shown: as the prompt shows them.
        recorded: the same as they were recorded, before rows of one plan were made to agree.
    """

    shown: tuple[Demonstration, ...]
    recorded: tuple[Demonstration, ...]

    def only(self, names: Collection[str]) -> "Demonstrations":
        """The same with these of their objects."""
        shown, recorded = (tuple(item.only(names) for item in items) for items in (self.shown, self.recorded))
        return Demonstrations(shown, recorded)

    def without_rare_plans(self) -> "Demonstrations":
        """Those that a prompt shows where nobody named them."""
        kept = {demonstration.id for demonstration in shown_together(self.recorded)}
        shown, recorded = (tuple(item for item in items if item.id in kept) for items in (self.shown, self.recorded))
        return Demonstrations(shown, recorded)


def read_demonstrations(
    connection: Connection,
    task: str,
    ids: Sequence[str],
    settings: TaskSettings,
    *,
    all_of_them: bool = False,
    stepwise: bool = False,
) -> Demonstrations:
    """The demonstrations of the named episodes.

    Args:
        all_of_them: also those of a rare plan, which a prompt otherwise leaves out.
        stepwise: for a closed loop, each with its own keyframes: the objects were tracked to these.

    Raises:
        NotFoundError: naming the first id that is no episode of this task.
    """
    records = episodes.demonstrations_by_id(connection, task, ids)
    if stepwise:
        return _unaligned(records, settings)

    def trajectories() -> tuple[Trajectory, ...]:
        return get_trajectories(connection, ids)

    return demonstrations_of(records, trajectories, settings, all_of_them=all_of_them)


def demonstrations_of(
    records: Sequence[DemonstrationRecord],
    trajectories: Callable[[], Sequence[Trajectory]],
    settings: TaskSettings,
    *,
    all_of_them: bool = False,
) -> Demonstrations:
    """The demonstrations of records.

    Args:
        trajectories: reads those of the records, in their order; called where the task's keyframe rule needs them.
    """
    if not settings.keyframes.keyframe_rule().aligned:
        return _unaligned(records, settings)
    recorded = aligned_by_plan(recordings_of(records, trajectories(), settings))
    if not all_of_them:
        recorded = shown_together(recorded)
    return Demonstrations(agreeing(recorded), recorded)


def read_compared(
    connection: Connection, task: str, ids: Sequence[str], settings: TaskSettings
) -> tuple[Compared, ...]:
    """The poses of the episodes' objects that came with images in which the objects were then found."""
    return tuple(
        pair
        for record in episodes.by_ids(connection, task, ids).values()
        for pair in settings.compared(
            map(ObjectQuery.from_json, record.given_objects), [item.pose() for item in record.objects]
        )
    )


def read_hands(
    connection: Connection, task: str, recorded: Sequence[Demonstration], settings: TaskSettings
) -> tuple[RecordedHand, ...]:
    """What the hand did in the recording of each of the task's demonstrations."""
    ids = [demonstration.id for demonstration in recorded]
    records = episodes.demonstrations_by_id(connection, task, ids)
    delta_rad_s, hands = settings.keyframes.keyframe_rule().delta_rad_s, []
    for shown, trajectory, record in zip(recorded, get_trajectories(connection, ids), records, strict=True):
        motion = settings.motion_of(trajectory, record.control_frequency_hz)
        hands.append(RecordedHand.of(motion, shown, kept(motion, shown.actions, delta_rad_s)))
    return tuple(hands)


def recordings_of(
    records: Sequence[DemonstrationRecord], trajectories: Sequence[Trajectory], settings: TaskSettings
) -> list[Recording]:
    """The demonstrations of records as they were found, each with the trajectory that it was made from."""
    rule, recordings = settings.keyframes.keyframe_rule(), []
    found = _demonstrations(records, settings)
    for demonstration, record, trajectory in zip(found, records, trajectories, strict=True):
        motion = settings.motion_of(trajectory, record.control_frequency_hz)
        recordings.append(Recording(replace(demonstration, start=trajectory.action_at(0)), motion, rule))
    return recordings


def _unaligned(records: Sequence[DemonstrationRecord], settings: TaskSettings) -> Demonstrations:
    canonical = tuple(_demonstrations(records, settings))
    return Demonstrations(canonical, canonical)


def _demonstrations(records: Sequence[DemonstrationRecord], settings: TaskSettings) -> list[Demonstration]:
    """As they were found, with the objects that all have: what only some have does not matter to the task."""
    found = [canonical_demonstration(record.demonstration(), settings) for record in records]
    names = in_all([[pose.name for pose in demonstration.objects] for demonstration in found])
    return [demonstration.only(names) for demonstration in found]


def in_all(names: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Those of the first scene's names that all scenes have."""
    return tuple(name for name in names[0] if all(name in others for others in names)) if names else ()


def canonical_demonstration(demonstration: Demonstration, settings: TaskSettings) -> Demonstration:
    """The demonstration as prompts show it: symmetric objects at their canonical yaw."""
    later = tuple(settings.canonical(objects) for objects in demonstration.later_objects)
    return replace(demonstration, objects=settings.canonical(demonstration.objects), later_objects=later)
