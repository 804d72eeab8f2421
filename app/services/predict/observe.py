"""A request's scene: the objects' poses in the task's order, as given or as estimated from images."""

from dataclasses import dataclass

from app.perception.registry import estimate_poses
from app.pipeline.errors import ObjectSetError
from app.pipeline.findings.units import check_scene_units
from app.pipeline.prompt import check_object_names
from app.services.errors import NoDemonstrationsError
from app.services.measures import timed
from app.services.pose_servers import PoseServers
from app.services.predict.request import PredictRequest
from app.services.scene_images import check_colors, with_templates
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.blobs import BlobStore
from app.store.errors import ConflictError
from app.store.records import TaskRecord
from app.store.store import Store
from roboprompt_client.types.poses import ObjectPose


@dataclass(frozen=True, eq=False)
class Scene:
    """The objects that a request observed.

    Attributes:
        objects: those of the task, in its order.
        absent: names of the task's objects that were not observed.
        bystanders: observed objects that the task does not have.
    """

    objects: tuple[ObjectPose, ...]
    absent: tuple[str, ...] = ()
    bystanders: tuple[ObjectPose, ...] = ()


@dataclass(frozen=True, eq=False)
class Seen:
    """A scene estimated from images with the settings of `task`."""

    task: TaskRecord
    scene: Scene

    def scene_of(self, task: TaskRecord) -> Scene:
        """Return the scene if `task` has the settings and objects that it was estimated with.

        Raises:
            ConflictError: if they changed.
        """
        if (task.settings, task.object_names) != (self.task.settings, self.task.object_names):
            raise ConflictError(f"task {task.name!r} changed while its images were looked at: send the request again")
        return self.scene


def look(store: Store, pose_servers: PoseServers, request: PredictRequest) -> Seen:
    """Estimate poses from the request's images, outside of a transaction: a pose server may take seconds.

    Raises:
        as `check_colors` and `observed`; NotFoundError for an unknown task.
    """
    with timed("read"), store.read() as connection:
        task = tasks.get(connection, request.task)
        newest = episodes.list_page(connection, request.task, limit=1).items
    settings = TaskSettings.model_validate(task.settings)
    pose_servers.check(settings.object_models)
    with timed("poses"):
        check_colors(store.blobs, (camera for episode in newest for camera in episode.cameras), request.frames)
        return Seen(task, observed(request, task, settings, store.blobs))


def observed(request: PredictRequest, task: TaskRecord, settings: TaskSettings, blobs: BlobStore) -> Scene:
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
    return Scene(
        tuple(by_name[name] for name in names if name in by_name),
        tuple(name for name in names if name not in by_name),
        tuple(pose for name, pose in by_name.items() if name not in names),
    )
