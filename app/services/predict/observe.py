"""What a request observed: its objects' poses in the task's order, given or found in images."""

from dataclasses import dataclass

from app.perception.registry import estimate_poses
from app.pipeline.findings.units import check_scene_units
from app.pipeline.prompt import check_object_names
from app.services.errors import NoDemonstrationsError
from app.services.measures import timed
from app.services.pose_servers import PoseServers
from app.services.predict.request import PredictRequest
from app.services.task_settings import TaskSettings
from app.services.templates import with_templates
from app.store import tasks
from app.store.blobs import BlobStore
from app.store.errors import ConflictError
from app.store.records import TaskRecord
from app.store.store import Store
from roboprompt_client.trajectory import ObjectPose


@dataclass(frozen=True, eq=False)
class Seen:
    """The objects that were found with the settings of `task`."""

    task: TaskRecord
    objects: tuple[ObjectPose, ...]

    def objects_of(self, task: TaskRecord) -> tuple[ObjectPose, ...]:
        """The objects, if `task` still wants them found so.

        Raises:
            ConflictError: if not.
        """
        if (task.settings, task.object_names) != (self.task.settings, self.task.object_names):
            raise ConflictError(f"task {task.name!r} changed while its images were looked at: send the request again")
        return self.objects


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


def observed(
    request: PredictRequest, task: TaskRecord, settings: TaskSettings, blobs: BlobStore
) -> tuple[ObjectPose, ...]:
    """The observed objects' poses in the task's order, symmetric objects at their canonical yaw.

    Raises:
        NoDemonstrationsError: if the task has no demonstrations.
        ObjectSetError: if the request has other objects; as `estimate_poses` and `check_scene_units`.
    """
    sent = [query.name for query in request.objects]
    if task.object_names is None:
        raise NoDemonstrationsError(task.name)
    check_object_names(sent, task.object_names)
    queries = with_templates(settings.with_models(request.objects), blobs)
    poses = estimate_poses(settings.pose_estimator, queries, request.frames, given_first=True)
    check_scene_units(poses, settings.workspace.workspace())
    by_name = {pose.name: pose for pose in poses}
    return settings.canonical(tuple(by_name[name] for name in task.object_names))
