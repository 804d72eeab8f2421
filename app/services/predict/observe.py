"""The objects of a robot's request: given, or found in its images."""

from dataclasses import dataclass

from app.perception.registry import estimate_poses
from app.pipeline.prompt import check_object_names, objects_of_task
from app.pipeline.units import check_scene_units
from app.services.limits import NoDemonstrationsError
from app.services.predict.question import PredictRequest
from app.services.task_settings import TaskSettings
from app.store.errors import ConflictError
from app.store.records import TaskRecord
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


def observed_objects(request: PredictRequest, task: TaskRecord, settings: TaskSettings) -> tuple[ObjectPose, ...]:
    """The observed objects' poses in the task's order, symmetric objects at their canonical yaw.

    Raises:
        NoDemonstrationsError: if the task has none, and the request asks for no other task's.
        InvalidInputError, ObjectSetError: if the observation does not fit the task.
    """
    given = [query.name for query in request.objects]
    names = task.object_names
    if names is None and request.options.demonstrations_from is not None:
        names = tuple(dict.fromkeys(given))  # a task without episodes has those that the robot sees
    if names is None:
        raise NoDemonstrationsError(request.task)
    check_object_names(given, names)
    queries = settings.with_models(request.objects)
    poses = estimate_poses(settings.pose_estimator, queries, request.frames, given_first=True)
    check_scene_units(poses, settings.workspace.workspace())
    return settings.canonical(objects_of_task(poses, names))
