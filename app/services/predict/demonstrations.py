"""A task's demonstrations within one read transaction, cached by the task's version."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter

from sqlalchemy import Connection

from app.perception.base import ObjectQuery
from app.pipeline.episode import Demonstration
from app.pipeline.finding import Finding
from app.pipeline.groups import made_by_group
from app.pipeline.plans import agreeing, demonstrated
from app.pipeline.plans.choice import PlanChooser
from app.pipeline.plans.recording import Recording, alike_turned
from app.pipeline.plans.symmetry import Symmetries, folded, shown_symmetries
from app.pipeline.plans.tries import without_tries
from app.pipeline.skill.recording import Recording as SkillRecording
from app.pipeline.skill.skills import Skills
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.poses import Compared, compared
from app.services.predict.request import PredictOptions
from app.services.predict.scenes import Ids, Scenes, in_all
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import DemonstrationRecord, EpisodeRecord, TaskRecord, TaskState
from app.store.trajectories import get_trajectories
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose

MAX_HELD_AGAINST = 50  # demonstrations of a task
MAX_CHOICES = 4  # of a task's demonstrations that are kept
_FORM = attrgetter("demonstration.order.form")


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


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """Some of a task's demonstrations.

    Attributes:
        shown: as prompts show them, with rows of one plan at their robust center.
        recorded: the same with rows as they were recorded.
        aligned: whether demonstrations of one plan have equally many rows.
    """

    shown: tuple[Demonstration, ...]
    recorded: tuple[Demonstration, ...]
    aligned: bool = False

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> "Demonstrations":
        recorded = demonstrated(recordings)
        aligned = bool(recordings) and recordings[0].rule.aligned
        return cls(agreeing(recorded) if aligned else recorded, recorded, aligned)

    def only(self, names: Collection[str]) -> "Demonstrations":
        """Return the same without their other objects."""
        shown, recorded = (tuple(item.only(names) for item in items) for items in (self.shown, self.recorded))
        return replace(self, shown=shown, recorded=recorded)

    @cached_property
    def plans(self) -> PlanChooser | None:
        """The chooser among their plans; None if rows are not aligned."""
        return PlanChooser(self.recorded) if self.aligned else None


def recordings_of(
    connection: Connection, records: Sequence[DemonstrationRecord], settings: TaskSettings
) -> Sequence[Recording]:
    """Return each record's demonstration with the motion of its trajectory; objects that not all have are left out."""
    rule, recorded = settings.keyframes.keyframe_rule(), []
    trajectories = get_trajectories(connection, [record.id for record in records])
    stored = [record.demonstration() for record in records]
    found = [replace(item, objects=settings.canonical(item.objects)) for item in stored]
    names = in_all([[pose.name for pose in demonstration.objects] for demonstration in found])
    for demonstration, record, trajectory in zip(found, records, trajectories, strict=True):
        motion = settings.motion_of(trajectory, record.control_frequency_hz)
        recorded.append(Recording(replace(demonstration.only(names), start=trajectory.action_at(0)), motion, rule))
    recordings = made_by_group(recorded, _FORM, without_tries) if rule.aligned else recorded
    return made_by_group(recordings, _FORM, alike_turned) if settings.gripper_symmetry_deg else recordings


def skills_of(
    connection: Connection, records: Sequence[DemonstrationRecord], settings: TaskSettings, names: Collection[str]
) -> Skills:
    """Return the skills of records, with only the objects of these names in their scenes."""
    trajectories = get_trajectories(connection, [record.id for record in records])
    stored = [record.demonstration().only(names) for record in records]
    recordings = [
        SkillRecording.of(
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
        self.symmetries: Symmetries | None = None
        self.demonstrations: Cache[Ids, Demonstrations] = Cache(MAX_CHOICES)
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
        self._read: dict[Ids, Sequence[Recording]] = {}

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
        return self.kept.skills.get_or_make(tuple(sorted(ids)), lambda: self._skills(tuple(sorted(ids))))

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

    def demonstrations(self, ids: Ids) -> Demonstrations:
        """Of those ids, those of one plan with equally many rows.

        Raises:
            NotFoundError: naming the first id that is no episode of this task.
        """
        return self.kept.demonstrations.get_or_make(ids, lambda: self._demonstrations(ids))

    def _demonstrations(self, ids: Ids) -> Demonstrations:
        recordings = folded(self._recordings(ids), self.symmetries)
        return Demonstrations.of(recordings).only(self.record.object_names or ())

    def _recordings(self, ids: Ids) -> Sequence[Recording]:
        if ids not in self._read:
            records = episodes.demonstrations_by_id(self.connection, self.record.name, ids)
            self._read[ids] = recordings_of(self.connection, records, self.kept.settings)
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
