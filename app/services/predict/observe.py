"""Where a request's objects are: given, or found in its images."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.perception.registry import estimate_poses
from app.pipeline.prompt import check_object_names, objects_of_task
from app.pipeline.units import check_scene_units
from app.services.limits import NoDemonstrationsError
from app.services.measures import Timings, timed
from app.services.pose_servers import PoseServers
from app.services.predict.question import PredictRequest
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


def look(store: Store, pose_servers: PoseServers, request: PredictRequest, timings_ms: Timings) -> Seen:
    """What the images show, found without a transaction open: a server may be asked.

    Raises:
        as `observed`, and NoDemonstrationsError.
    """
    with timed(timings_ms, "read"), store.read() as connection:
        task = tasks.get(connection, request.task)
    settings = TaskSettings.model_validate(task.settings)
    pose_servers.check(settings.object_models)
    with timed(timings_ms, "poses"):
        return Seen(task, observed(request, settings, object_names(request, task), store.blobs))


def object_names(request: PredictRequest, task: TaskRecord) -> tuple[str, ...]:
    """The objects of the task's demonstrations; those that the robot sees where it asks for other tasks' instead.

    Raises:
        NoDemonstrationsError: if the task has none, and the request asks for no other task's.
    """
    if task.object_names is not None:
        return tuple(task.object_names)
    if request.options.demonstrations_from is None:
        raise NoDemonstrationsError(task.name)
    return tuple(dict.fromkeys(query.name for query in request.objects))


def observed(
    request: PredictRequest, settings: TaskSettings, names: Sequence[str], blobs: BlobStore
) -> tuple[ObjectPose, ...]:
    """The observed objects' poses in the order of `names`, symmetric objects at their canonical yaw.

    Raises:
        ObjectSetError: if the request has other objects; as `estimate_poses` and `check_scene_units`.
    """
    check_object_names([query.name for query in request.objects], names)
    queries = with_templates(settings.with_models(request.objects), blobs)
    poses = estimate_poses(settings.pose_estimator, queries, request.frames, given_first=True)
    check_scene_units(poses, settings.workspace.workspace())
    return settings.canonical(objects_of_task(poses, names))
