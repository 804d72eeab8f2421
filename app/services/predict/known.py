"""Reads what a request needs: the observed scene, and in one transaction the task, its settings and demonstrations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.perception.registry import estimate_poses
from app.pipeline.errors import ObjectSetError
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.units import check_meters, check_scene_units
from app.pipeline.names import check_object_names
from app.pipeline.plans.symmetry import Symmetries
from app.services.errors import NoDemonstrationsError
from app.services.measures import timed
from app.services.pose_servers import PoseServers
from app.services.predict.demonstrations import Demonstrations
from app.services.predict.request import PredictRequest, PromptStyle
from app.services.predict.task_reading import TaskCaches, TaskReading
from app.services.scene_images import check_colors, with_templates
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.blobs import BlobStore
from app.store.errors import ConflictError
from app.store.filters import EpisodeFilter
from app.store.records import TaskRecord
from app.store.store import Store
from roboprompt_client.types.poses import ObjectPose, Pose


@dataclass(frozen=True, eq=False)
class ObservedScene:
    """The objects that a request observed.

    Attributes:
        objects: those of the task, in its order.
        absent: names of the task's objects that were not observed.
        bystanders: observed objects that the task does not have.
    """

    objects: tuple[ObjectPose, ...]
    absent: tuple[str, ...] = ()
    bystanders: tuple[ObjectPose, ...] = ()

    def folded(self, symmetries: Symmetries) -> "ObservedScene":
        """Return the scene with each symmetric object turned to the side that the hand takes."""
        objects = (symmetries[pose.name].folded(pose) if pose.name in symmetries else pose for pose in self.objects)
        return replace(self, objects=tuple(objects))


@dataclass(frozen=True, eq=False)
class Known:
    """A request's task and demonstrations as the store has them, with the observed scene.

    Attributes:
        settings: of the task.
        end_effector: its pose before the first action; None if unknown.
        profile: of the model to ask.
        demonstrations: those that the request names, or that its selection finds.
        chosen: whether the request names them.
        taught: all demonstrations of the task, with which an answer is compared.
        symmetries: those that the demonstrations show; scene and demonstrations have the objects folded.
    """

    settings: TaskSettings
    end_effector: Pose | None
    scene: ObservedScene
    profile: ModelProfile
    style: PromptStyle
    demonstrations: Demonstrations
    chosen: bool
    taught: Taught
    symmetries: Symmetries


class KnownReader:
    """Reads tasks for requests, and caches what does not depend on the request. Synchronous: call it in a thread.

    Args:
        profile_of: returns the profile of a named model, or of the default one (None); raises UnknownModelError.
    """

    def __init__(
        self,
        store: Store,
        profile_of: Callable[[str | None], ModelProfile],
        pose_servers: PoseServers | None = None,
    ) -> None:
        self._store = store
        self.profile_of = profile_of
        self._pose_servers = pose_servers or PoseServers()
        self._caches = TaskCaches()

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
        looked_with, scene = self._look(request) if request.frames else (None, None)
        with self._store.read() as connection:
            with timed("read"):
                task = TaskReading(connection, request.task, self._caches)
            record, settings = task.record, task.settings
            settings.limits_of_motion().require_start(request.end_effector)
            if request.end_effector is not None:
                place_m = np.array(request.end_effector.position_m)
                check_meters("end_effector.position", place_m, settings.workspace.workspace())
            if scene is None:
                with timed("poses"):
                    scene = observed(request, record, settings, self._store.blobs)
            elif looked_with != (record.settings, record.object_names):
                message = f"task {record.name!r} changed while its images were looked at: send the request again"
                raise ConflictError(message)
            with timed("prompt"):
                profile = self.profile_of(request.options.model)
                style = PromptStyle.of(request, settings, profile)
                taught = task.taught(style.from_start)
                demonstrations = task.demonstrations(task.ids(request.options, scene.objects))
                scene = scene.folded(task.symmetries)
        if scene.absent:
            present = [pose.name for pose in scene.objects]
            check_object_names(present, record.object_names or (), taught.needed | demonstrations.needed)
            taught = taught.of_objects(present)
        chosen = request.options.episode_ids is not None
        return Known(
            settings, request.end_effector, scene, profile, style, demonstrations, chosen, taught, task.symmetries
        )

    def _look(self, request: PredictRequest) -> tuple[tuple[object, object], ObservedScene]:
        """Return the scene that the request's images show, and the settings and object names that it was seen with."""
        with timed("read"), self._store.read() as connection:
            task = tasks.get(connection, request.task)
            newest = episodes.list_page(connection, EpisodeFilter(task=request.task), 1).items
        settings, blobs = TaskSettings.model_validate(task.settings), self._store.blobs
        self._pose_servers.check(settings.object_models)
        with timed("poses"):
            check_colors(blobs, (camera for episode in newest for camera in episode.cameras), request.frames)
            return (task.settings, task.object_names), observed(request, task, settings, blobs)

    def demonstrations(self, connection: Connection, task_name: str, ids: Sequence[str]) -> Demonstrations:
        """Return stored episodes of the task as its present settings read them.

        Raises:
            NotFoundError: for an unknown task, or an id that is no episode of it.
        """
        return TaskReading(connection, task_name, self._caches).demonstrations(tuple(ids))

    def usual(self, task_name: str) -> tuple[Demonstrations, TaskSettings, PromptStyle]:
        """Return demonstrations, settings and prompt style of a request with default options.

        Raises:
            as `__call__` for such a request.
        """
        request = PredictRequest(task_name, "", ())
        with self._store.read() as connection:
            task = TaskReading(connection, task_name, self._caches)
            style = PromptStyle.of(request, task.settings, self.profile_of(None))
            task.taught(style.from_start)  # cached for the next prediction
            return task.demonstrations(task.ids(request.options)), task.settings, style


def observed(request: PredictRequest, task: TaskRecord, settings: TaskSettings, blobs: BlobStore) -> ObservedScene:
    """Return the observed objects' poses, symmetric objects at their canonical yaw; some of the task's may be absent.

    Raises:
        NoDemonstrationsError: if the task has no demonstrations.
        ObjectSetError: if names are given twice or are spelled otherwise; as `estimate_poses` and `check_scene_units`.
    """
    sent, names = [query.name for query in request.objects], task.object_names
    if names is None:
        raise NoDemonstrationsError(task.name)
    check_object_names(sent, names, needed=())
    if called := next((alike.called for alike in request.alike if alike.called in names), None):
        message = f"given twice: {called}, of which demonstrations have one"
        raise ObjectSetError("objects", message, "the one that is meant alone, or demonstrations with several")
    queries = with_templates(settings.with_models(request.objects), blobs)
    poses = estimate_poses(settings.pose_estimator, queries, request.frames, given_first=True)
    check_scene_units([pose for pose in poses if pose.name in names], settings.workspace.workspace())
    by_name = {pose.name: pose for pose in settings.canonical(poses)}
    return ObservedScene(
        tuple(by_name[name] for name in names if name in by_name),
        tuple(name for name in names if name not in by_name),
        tuple(pose for name, pose in by_name.items() if name not in names),
    )
