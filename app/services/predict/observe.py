"""What a request observed: its objects' poses in the task's order, given or found in images."""

from dataclasses import dataclass

from app.perception.registry import estimate_poses
from app.pipeline.errors import ObjectSetError
from app.pipeline.findings.units import check_scene_units
from app.pipeline.prompt import check_object_names
from app.services.errors import NoDemonstrationsError
from app.services.measures import timed
from app.services.pose_servers import PoseServers
from app.services.predict.request import PredictRequest
from app.services.scene_images import with_templates
from app.services.task_settings import TaskSettings
from app.store import tasks
from app.store.blobs import BlobStore
from app.store.errors import ConflictError
from app.store.records import TaskRecord
from app.store.store import Store
from roboprompt_client.types.poses import ObjectPose


@dataclass(frozen=True, eq=False)
class Scene:
    """What a request observed.

    Attributes:
        objects: of the task, in its order.
        absent: names of the task's other objects.
        bystanders: that some demonstration does not have.
    """

    objects: tuple[ObjectPose, ...]
    absent: tuple[str, ...] = ()
    bystanders: tuple[ObjectPose, ...] = ()


@dataclass(frozen=True, eq=False)
class Seen:
    """The scene as it was found with the settings of `task`."""

    task: TaskRecord
    scene: Scene

    def scene_of(self, task: TaskRecord) -> Scene:
        """The scene, if `task` still wants its objects found so.

        Raises:
            ConflictError: if not.
        """
        if (task.settings, task.object_names) != (self.task.settings, self.task.object_names):
            raise ConflictError(f"task {task.name!r} changed while its images were looked at: send the request again")
        return self.scene


def look(store: Store, pose_servers: PoseServers, request: PredictRequest) -> Seen:
    """What the images show, found without a transaction open: a server may be asked.

    Raises:
        as `observed`; NotFoundError for an unknown task.
    """
    with timed("read"), store.read() as connection:
        task = tasks.get(connection, request.task)
    settings = TaskSettings.model_validate(task.settings)
    pose_servers.check(settings.object_models)
    with timed("poses"):
        return Seen(task, observed(request, task, settings, store.blobs))


def observed(request: PredictRequest, task: TaskRecord, settings: TaskSettings, blobs: BlobStore) -> Scene:
    """The observed objects' poses, symmetric objects at their canonical yaw. Objects of the task may be absent.

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
    own, under_way = [pose for pose in poses if pose.name in names], request.options.after is not None
    check_scene_units(own, settings.workspace.workspace(), under_way=under_way)
    by_name = {pose.name: pose for pose in settings.canonical(poses)}
    return Scene(
        tuple(by_name[name] for name in names if name in by_name),
        tuple(name for name in names if name not in by_name),
        tuple(pose for name, pose in by_name.items() if name not in names),
    )
