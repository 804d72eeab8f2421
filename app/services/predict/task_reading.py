"""A task within one read transaction: settings, selections and demonstrations, cached by the task's version."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from sqlalchemy import Connection

from app.pipeline.findings.demonstrations import Taught
from app.pipeline.plans.recording import Recording
from app.pipeline.plans.symmetry import Symmetries, folded, shown_symmetries
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.predict.demonstrations import (
    Demonstrations,
    hands_of,
    in_all,
    read_compared,
    read_rotations,
    recordings_of,
)
from app.services.predict.request import PredictOptions
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import TaskRecord, TaskState
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

MAX_HELD_AGAINST = 50  # demonstrations of a task
MAX_CHOICES = 4  # of a task's demonstrations that are kept

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


class TaskVersion:
    """What is known of one version of a task whatever a request asks; made when it is needed, shared by requests.

    Attributes:
        settings, workspace, limits: the validated settings, and what follows from them.
    """

    def __init__(self, task: TaskRecord) -> None:
        self.settings = TaskSettings.model_validate(task.settings)
        self.workspace = self.settings.workspace.workspace()
        self.limits = self.settings.limits_of_motion()
        self.scenes: Scenes | None = None  # 10,000 of three objects take 1 MB
        self.symmetries: Symmetries | None = None
        self.diverse: dict[int, Ids] = {}
        self.demonstrations: Cache[Ids, Demonstrations] = Cache(MAX_CHOICES)
        self.taught: dict[bool, Taught] = {}


KeptTasks = Cache[TaskState, TaskVersion]


class TaskReading:
    """A task in the transaction of `connection`.

    Attributes:
        record: as it is stored.
        kept: of its version.

    Raises:
        NotFoundError: if there is no such task.
    """

    def __init__(self, connection: Connection, name: str, kept: KeptTasks) -> None:
        self.record = task = tasks.get(connection, name)
        self.kept = kept.get_or_make(task.state, lambda: TaskVersion(task))
        self._connection = connection
        self._read: dict[Ids, Sequence[Recording]] = {}

    def asked(
        self, options: PredictOptions, observed: Sequence[ObjectPose], *, from_start: bool
    ) -> tuple[Taught, Demonstrations, tuple[ObjectPose, ...]]:
        """Return what answers are compared with, the demonstrations for the prompt, and the objects as both have them.

        Raises:
            as `taught`, `ids` and `demonstrations`.
        """
        taught = self.taught(from_start)
        return taught, self.demonstrations(self.ids(options, observed)), self.folded(observed)

    def ids(self, options: PredictOptions, objects: Sequence[ObjectPose] = ()) -> Ids:
        """Return the ids of the demonstrations that a request names, or that its selection finds.

        Args:
            objects: as observed, for the selection `nearest`; it puts the nearest last, where a language model attends
                to it most.

        Raises:
            InvalidInputError: for a named episode that is left out of prompts.
        """
        if options.episode_ids is not None:
            left_out = episodes.left_out_of(self._connection, options.episode_ids)
            for number, id_ in enumerate(options.episode_ids):
                if id_ in left_out:
                    remedy = f'others, or PATCH /episodes/{id_} with {{"left_out": false}}'
                    raise InvalidInputError(f"episode_ids[{number}]", f"{id_} is left out of prompts", remedy)
            return options.episode_ids
        number = options.num_demonstrations or self.kept.settings.num_demonstrations
        if options.selection == "diverse":
            return self._diverse(number)
        scenes = self._scenes()
        match options.selection:
            case "first":
                return scenes.ids[:number]
            case "recent":
                return scenes.ids[-number:]
            case "random":
                return tuple(random.Random(options.seed).sample(scenes.ids, min(number, len(scenes.ids))))
            case "nearest":
                return scenes.nearest_last(objects, number)

    def _diverse(self, number: int) -> Ids:
        if number not in self.kept.diverse:
            self.kept.diverse[number] = self._scenes().most_diverse(number)
        return self.kept.diverse[number]

    def _scenes(self) -> Scenes:
        if self.kept.scenes is None:
            self.kept.scenes = Scenes.read(self._connection, self.record.name)
        return self.kept.scenes

    def demonstrations(self, ids: Ids) -> Demonstrations:
        """Of those ids, those of one plan with equally many rows.

        Raises:
            NotFoundError: naming the first id that is no episode of this task.
        """
        return self.kept.demonstrations.get_or_make(ids, lambda: self._demonstrations(ids))

    def _demonstrations(self, ids: Ids) -> Demonstrations:
        recordings = folded(self._recordings(ids), self.symmetries)
        found = Demonstrations.of(recordings).only(self.record.object_names or ())
        return replace(found, hands=hands_of(recordings, found.recorded)) if ids == self._held_against else found

    def _recordings(self, ids: Ids) -> Sequence[Recording]:
        if ids not in self._read:
            records = episodes.demonstrations_by_id(self._connection, self.record.name, ids)
            self._read[ids] = recordings_of(self._connection, records, self.kept.settings)
        return self._read[ids]

    @property
    def symmetries(self) -> Symmetries:
        """The symmetries that the demonstrations show, of objects of which the settings say nothing."""
        if self.kept.symmetries is None:
            declared = self.kept.settings.yaw_symmetry_deg
            self.kept.symmetries = shown_symmetries(self._recordings(self._held_against), declared)
        return self.kept.symmetries

    def folded(self, poses: Sequence[ObjectPose]) -> tuple[ObjectPose, ...]:
        """Return observed poses with each symmetric object turned to the side that demonstrations have."""
        turned = self.kept.settings.canonical(poses)
        symmetries = self.symmetries
        return tuple(symmetries[pose.name].folded(pose) if pose.name in symmetries else pose for pose in turned)

    @property
    def _held_against(self) -> Ids:
        """The ids of the demonstrations with which answers are compared."""
        return self._diverse(MAX_HELD_AGAINST)

    def taught(self, from_start: bool) -> Taught:
        """Return all demonstrations of the task (of more than 50 those whose scenes lie farthest apart) for comparison.

        They do not depend on the episodes that a request names, which may show one of several ways by chance.

        Args:
            from_start: whether rows may be relative to the end effector's start pose.

        Raises:
            NoDemonstrationsError: if there is none, or all are left out.
        """
        if from_start not in self.kept.taught:
            self.kept.taught[from_start] = self._taught(from_start)
        return self.kept.taught[from_start]

    def _taught(self, from_start: bool) -> Taught:
        if not (ids := self._held_against):
            raise NoDemonstrationsError(self.record.name)
        known, settings = self.demonstrations(ids), self.kept.settings
        recorded = known.recorded if from_start else tuple(replace(item, start=None) for item in known.recorded)
        return Taught(
            recorded,
            several_ways=settings.ways == "several",
            hands=known.hands,
            round_objects=frozenset(settings.yaw_symmetry_deg),
            given_xyzw=read_rotations(self._connection, self.record.name, ids, settings),
            compared=read_compared(self._connection, self.record.name, ids, settings),
        )
