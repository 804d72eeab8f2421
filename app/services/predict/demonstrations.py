"""A task's demonstrations within one read transaction, cached by the task's version."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

from app.perception.base import ObjectQuery
from app.pipeline.finding import Finding
from app.pipeline.skill.recording import Recording
from app.pipeline.skill.skills import Skills
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.poses import Compared, compared
from app.services.predict.request import PredictOptions
from app.services.predict.scenes import Ids, Scenes
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import DemonstrationRecord, EpisodeRecord, TaskRecord, TaskState
from app.store.trajectories import get_trajectories
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose

MAX_HELD_AGAINST = 50  # demonstrations of a task
MAX_CHOICES = 4  # of a task's demonstrations that are kept


@dataclass(frozen=True, eq=False)
class PoseSources:
    """How objects of demonstrations were measured.

    Attributes:
        estimators: by name of the object.
        compared: objects with both a given pose and one found in images.
    """

    estimators: Mapping[str, frozenset[str]]
    compared: tuple[Compared, ...]

    @classmethod
    def of(cls, records: Iterable[EpisodeRecord], settings: TaskSettings) -> "PoseSources":
        found: defaultdict[str, set[str]] = defaultdict(set)
        pairs: list[Compared] = []
        for record in records:
            for item in record.objects:
                found[item.name].add(item.estimator)
            pairs += _compared(record, settings)
        return cls({name: frozenset(estimators) for name, estimators in found.items()}, tuple(pairs))


def skills_of(
    connection: Connection, records: Sequence[DemonstrationRecord], settings: TaskSettings, names: Collection[str]
) -> Skills:
    """Return the skills of records, with only the objects of these names in their scenes."""
    trajectories = get_trajectories(connection, [record.id for record in records])
    stored = [record.demonstration().only(names) for record in records]
    recordings = [
        Recording.of(
            item,
            settings.motion_of(trajectory, record.control_frequency_hz),
            settings.yaw_symmetry_deg,
            settings.keyframes.keyframe_rule(),
        )
        for item, record, trajectory in zip(stored, records, trajectories, strict=True)
    ]
    return Skills(tuple(recordings), settings.yaw_symmetry_deg, tuple(names))


class TaskVersion:
    """What is known of one version of a task whatever a request asks; made when it is needed, shared by requests.

    Attributes:
        settings, workspace, limits: the validated settings, and what follows from them.
    """

    def __init__(self, connection: Connection, task: TaskRecord) -> None:
        self.settings = TaskSettings.read(connection, task)
        self.workspace = self.settings.workspace.workspace()
        self.limits = self.settings.limits_of_motion()
        self.scenes: Scenes | None = None  # 10,000 of three objects take 1 MB
        self.sources: PoseSources | None = None
        self.skills: Cache[Ids, Skills] = Cache(MAX_CHOICES)


class TaskReading:
    """A task in the transaction of `connection`, its demonstrations as its settings want them.

    Attributes:
        record: as it is stored.
        kept: of its version.
    """

    def __init__(self, connection: Connection, task: TaskRecord, kept: Cache[TaskState, TaskVersion]) -> None:
        self.record = task
        self.kept = kept.get_or_make(task.state, lambda: TaskVersion(connection, task))
        self.connection = connection

    def selected(self, options: PredictOptions, objects: Sequence[ObjectPose]) -> Ids:
        """Return the ids of episodes that a request names, or that its selection finds for these observed objects.

        Raises:
            InvalidInputError: for a named episode that is left out of prompts.
        """
        if options.episode_ids is not None:
            self._require_shown(options.episode_ids)
            return options.episode_ids
        number = options.num_demonstrations or self.kept.settings.num_demonstrations
        return self._scenes.selected(options, number, objects)

    def skills_of(self, ids: Ids) -> Skills:
        """Return the skills of the demonstrations with these ids, whatever their order.

        Raises:
            NotFoundError: naming the first id that is no episode of this task.
        """
        chosen = set(ids)
        oldest_first = [id_ for id_ in self._scenes.ids if id_ in chosen]  # ids are random: what is equal is decided so
        ordered = tuple(dict.fromkeys([*oldest_first, *ids]))
        return self.kept.skills.get_or_make(ordered, lambda: self._skills(ordered))

    def _skills(self, ids: Ids) -> Skills:
        records = episodes.demonstrations_by_id(self.connection, self.record.name, ids)
        return skills_of(self.connection, records, self.kept.settings, self.record.object_names or ())

    def _require_shown(self, ids: Ids) -> None:
        left_out = episodes.left_out_of(self.connection, ids)
        for number, id_ in enumerate(ids):
            if id_ in left_out:
                remedy = f'others, or PATCH /episodes/{id_} with {{"left_out": false}}'
                raise InvalidInputError(f"episode_ids[{number}]", f"{id_} is left out of prompts", remedy)

    @property
    def _scenes(self) -> Scenes:
        if self.kept.scenes is None:
            self.kept.scenes = Scenes.read(self.connection, self.record.name)
        return self.kept.scenes

    @property
    def _held_against(self) -> Ids:
        """The ids of the demonstrations with which answers are compared."""
        return self._scenes.most_diverse(MAX_HELD_AGAINST)

    @property
    def skills(self) -> Skills:
        """The skills of all demonstrations of the task, of more than 50 of those whose scenes lie farthest apart.

        Raises:
            NoDemonstrationsError: if there is none, or all are left out.
        """
        self.require_demonstrations()
        return self.skills_of(self._held_against)

    @property
    def doubts(self) -> tuple[Finding, ...]:
        """The doubts about all demonstrations; none if there are no demonstrations."""
        return self.skills.of_demonstrations if self.has_demonstrations else ()

    @property
    def has_demonstrations(self) -> bool:
        """Whether prompts may show any episode."""
        return bool(self._held_against)

    def require_demonstrations(self) -> None:
        """Raise NoDemonstrationsError if there is none, or all are left out."""
        if not self.has_demonstrations:
            raise NoDemonstrationsError(self.record.name)

    @property
    def sources(self) -> PoseSources:
        """How the demonstrations' objects were measured."""
        if self.kept.sources is None:
            records = episodes.by_ids(self.connection, self.record.name, self._held_against)
            self.kept.sources = PoseSources.of(records.values(), self.kept.settings)
        return self.kept.sources


def _compared(record: EpisodeRecord, settings: TaskSettings) -> tuple[Compared, ...]:
    """Return the uploaded poses of an episode's objects beside those found in its images."""
    given = map(ObjectQuery.from_json, record.given_objects)
    return compared(given, [item.pose() for item in record.objects], settings)
