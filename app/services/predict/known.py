"""Reads what a request needs: the observed scene, and in one transaction the task, its settings and demonstrations."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace

import numpy as np
from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.pipeline.finding import Finding
from app.pipeline.inputs import check_meters, check_scene_units
from app.pipeline.names import check_object_names
from app.pipeline.skill.skills import Skills
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.extract import reading
from app.services.images import check_colors
from app.services.measures import timed
from app.services.poses import PoseServers, poses_of
from app.services.predict.demonstrations import PoseSources, TaskReading, TaskVersion
from app.services.predict.request import PredictOptions, PredictRequest, PromptStyle
from app.services.predict.scenes import Ids
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.errors import ConflictError
from app.store.filters import EpisodeFilter
from app.store.records import TaskRecord, TaskState
from app.store.store import Store
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.types.poses import ObjectPose

MAX_TASKS = 64  # whose present version is kept, each with a few choices of demonstrations


@dataclass(frozen=True, eq=False)
class Known:
    """A request's task and demonstrations as the store has them, with the observed objects.

    Attributes:
        task: settings and what follows from them.
        profile: of the model to ask.
        shown: the skills of the demonstrations that the request names, or that its selection finds.
        shown_ids: of these, in the order of the prompt.
        skills: of all demonstrations of the task, with which an answer is compared.
        sources: of their objects' poses.
        observed: the objects of the task, in its order, as the robot sent them or as images show them.
        objects: the same with symmetric objects turned to the side that demonstrations have.
        absent: names of the task's objects that were not observed.
        bystanders: observed objects that the task does not have, symmetric ones at their canonical yaw.
    """

    task: TaskVersion
    profile: ModelProfile
    style: PromptStyle
    shown: Skills
    shown_ids: Ids
    skills: Skills
    sources: PoseSources
    observed: tuple[ObjectPose, ...]
    objects: tuple[ObjectPose, ...]
    absent: tuple[str, ...]
    bystanders: tuple[ObjectPose, ...]

    @property
    def instructions(self) -> tuple[str, ...]:
        """The instructions of the demonstrations, in the order of the prompt."""
        by_id = {item.id: item.demonstration.instruction for item in self.shown.recordings}
        return tuple(by_id[id_] for id_ in self.shown_ids)


class KnownReader:
    """Reads tasks for requests, and caches what does not depend on the request. Synchronous: call it in a thread.

    Args:
        profile_of: returns the profile of a named model, or of the default one (None); raises UnknownModelError.
    """

    def __init__(
        self, store: Store, profile_of: Callable[[str | None], ModelProfile], pose_servers: PoseServers
    ) -> None:
        self._store, self._profile_of, self._pose_servers = store, profile_of, pose_servers
        self._kept: Cache[TaskState, TaskVersion] = Cache(MAX_TASKS)

    def __call__(self, request: PredictRequest) -> Known:
        """Return the task, demonstrations and scene of a request.

        Images are looked at before the transaction: a pose server may take seconds.

        Raises:
            UnknownModelError: for an unknown model.
            NotFoundError: for an unknown task or episode.
            NoDemonstrationsError: if the task has no episode yet.
            ConflictError: if the task's settings changed while its images were looked at.
            InvalidInputError, ObjectSetError: if the observation does not fit the task.
        """
        looked_with, poses = self._look(request) if request.frames else (None, ())
        with self.reading(request.task) as task:
            record, kept = task.record, task.kept
            kept.limits.require_start(request.end_effector)
            if request.end_effector is not None:
                place_m = np.array(request.end_effector.position_m)
                check_meters("end_effector.position", place_m, kept.workspace)
            if looked_with is None:
                with timed("poses"):
                    poses = self._poses(request, record, kept)
            elif looked_with != (record.settings, record.object_names):
                message = f"task {record.name!r} changed while its images were looked at: send the request again"
                raise ConflictError(message)
            with timed("prompt"):
                known = self._known(request, task, {pose.name: pose for pose in poses})
        if not known.absent:
            return known
        present = [pose.name for pose in known.observed]
        check_object_names(present, record.object_names or (), known.skills.needed | known.shown.needed)
        return replace(known, skills=known.skills.only(present), shown=known.shown.only(present))

    def _known(self, request: PredictRequest, task: TaskReading, poses: Mapping[str, ObjectPose]) -> Known:
        kept, names = task.kept, task.record.object_names or ()
        profile = self._profile_of(request.options.model)
        from_start = request.end_effector is not None
        style = PromptStyle.of(request.options, kept.settings, profile, from_start=from_start)
        observed = tuple(poses[name] for name in names if name in poses)
        ids = task.selected(request.options, observed)
        shown = task.skills_of(ids)
        return Known(
            kept,
            profile,
            style,
            shown if from_start else shown.without_start,
            ids,
            task.skills,
            task.sources,
            observed,
            objects=kept.settings.canonical(observed),
            absent=tuple(name for name in names if name not in poses),
            bystanders=kept.settings.canonical(pose for name, pose in poses.items() if name not in names),
        )

    def _look(self, request: PredictRequest) -> tuple[tuple[object, object], tuple[ObjectPose, ...]]:
        """Return settings and object names of the task, and the poses that the request's images show with these."""
        with timed("read"), self._store.read() as connection:
            record = tasks.get(connection, request.task)
            newest = episodes.list_page(connection, EpisodeFilter(task=request.task), 1).items
            task = TaskVersion(connection, record)
        usual = (camera for episode in newest for camera in episode.cameras)
        self._pose_servers.check(task.settings.object_models)
        with timed("poses"):
            check_colors(self._store.blobs, usual, request.frames)
            return (record.settings, record.object_names), self._poses(request, record, task)

    def _poses(self, request: PredictRequest, record: TaskRecord, task: TaskVersion) -> tuple[ObjectPose, ...]:
        """Return the poses of a request's objects; some of the task's may be absent, and others present.

        Raises:
            NoDemonstrationsError: if the task has no demonstrations.
            ObjectSetError: if names are given twice or are spelled otherwise.
            as `estimate_poses` and `check_scene_units`.
        """
        sent, names = [query.name for query in request.objects], record.object_names
        if names is None:
            raise NoDemonstrationsError(record.name)
        check_object_names(sent, names, needed=())
        poses = poses_of(request.objects, task.settings, request.frames, self._store.blobs, given_first=True)
        check_scene_units([pose for pose in poses if pose.name in names], task.workspace)
        return poses

    @contextmanager
    def reading(self, name: str, *, strict: bool = True) -> Iterator[TaskReading]:
        """Yield a task in a read transaction; raises as `app.services.extract.reading`."""
        with ExitStack() as stack:
            with timed("read"):
                now = stack.enter_context(reading(self._store, name, fresh=self._kept, strict=strict))
                # what is read of episodes that are not as the settings want them is not kept
                task = TaskReading(now.connection, now.task, Cache(1) if now.refused else self._kept)
            yield task

    def doubts(self, name: str) -> tuple[Finding, ...]:
        """Return the doubts about a task's demonstrations: uploads, checks, predictions and pages say the same.

        Raises:
            NotFoundError: if there is no such task.
        """
        with self.reading(name, strict=False) as task:
            return task.doubts

    def limits(self, connection: Connection, task: str) -> MotionLimits:
        """Return the task's present limits of motion; raises NotFoundError if there is no such task."""
        record = tasks.get(connection, task)
        if record.state in self._kept:
            return TaskReading(connection, record, self._kept).kept.limits
        return TaskSettings.read(connection, record).limits_of_motion()

    def present_limits(self, task: str) -> MotionLimits:
        """The same in a transaction of its own."""
        with self._store.read() as connection:
            return self.limits(connection, task)

    def usual(self, task_name: str) -> tuple[Skills, Ids, TaskSettings, PromptStyle]:
        """Return skills and ids of demonstrations, settings and prompt style of a request with default options.

        Raises:
            as `__call__` for such a request.
        """
        options = PredictOptions()
        with self.reading(task_name) as task:
            style = PromptStyle.of(options, task.kept.settings, self._profile_of(None))
            task.require_demonstrations()
            ids = task.selected(options, ())
            return task.skills_of(ids).without_start, ids, task.kept.settings, style
