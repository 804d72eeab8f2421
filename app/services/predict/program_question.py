"""From a robot's request to the question of the method `voxposer`: no demonstrations, the objects with their points."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from app.llm.base import ModelProfile
from app.perception.points import ASSUMED_RADIUS_M, Source, object_points
from app.pipeline.findings import Finding
from app.pipeline.language.grounded import Grounded
from app.services.measures import Timings, timed
from app.services.pose_servers import PoseServers
from app.services.predict.doubts import findings_before
from app.services.predict.observe import observed
from app.services.predict.question import PredictRequest, ProgramQuestion
from app.services.predict.template import PromptStyle, Shown, cache_key_of
from app.services.task_settings import TaskSettings
from app.store import tasks
from app.store.records import TaskRecord
from app.store.store import Store
from app.voxposer.prompt import PROGRAM_TEMPLATE
from app.voxposer.scene import Scene, SeenObject
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion_limits import Pose
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose
from roboprompt_client.wording import checked_instruction

STYLE = PromptStyle("voxposer", "program", "none")
UNDEMONSTRATED = Finding(
    "undemonstrated-actions",
    "danger",
    "A program that the model wrote decides the actions: no demonstration holds them, only the bounds of motion do.",
)


class ProgramQuestionWriter:
    """Writes questions for programs. Synchronous: call it in a thread.

    Args:
        profile_of: as for `QuestionWriter`.
    """

    def __init__(
        self, store: Store, profile_of: Callable[[str | None], ModelProfile], pose_servers: PoseServers
    ) -> None:
        self._store = store
        self._profile_of = profile_of
        self._pose_servers = pose_servers

    def __call__(self, request: PredictRequest, timings_ms: Timings) -> ProgramQuestion:
        """The question that `request` puts to its model. The task may have no demonstrations yet.

        Raises:
            UnknownModelError, NotFoundError: for an unknown model or task.
            InvalidInputError, ObjectSetError: if the observation does not fit the task, or lacks the end effector.
        """
        instruction = checked_instruction("instruction", request.instruction)
        end_effector = _given(request.end_effector)
        profile = self._profile_of(request.options.model)
        with timed(timings_ms, "read"), self._store.read() as connection:
            task = tasks.get(connection, request.task)
        settings = TaskSettings.model_validate(task.settings)
        self._pose_servers.check(settings.object_models)
        with timed(timings_ms, "poses"):
            poses = observed(request, settings, _names(task, request), self._store.blobs)
            objects, sources = _with_points(request, settings, poses)
        start = EndEffectorAction(
            np.array(end_effector.position_m), np.array(end_effector.quaternion_xyzw), gripper_open=True
        )
        written = PROGRAM_TEMPLATE
        question = ProgramQuestion(
            request=request,
            grounded=Grounded(instruction),
            instructions=(instruction,),
            objects=poses,
            template=Shown(cache_key_of(written.system, written.prefix)),
            written=written,
            so_far="",
            step=None,
            profile=profile,
            style=STYLE,
            settings=settings,
            observed=poses,
            end_effector=end_effector,
            scene=Scene(settings.workspace.workspace(), objects, start),
        )
        return replace(question, findings=(UNDEMONSTRATED, *findings_before(question), *_assumed(poses, sources)))


def _given(end_effector: Pose | None) -> Pose:
    if end_effector is None:
        remedy = "where the gripper is now: position and quaternion_xyzw"
        raise InvalidInputError("end_effector", "is missing, and the method voxposer plans a way from it", remedy)
    return end_effector


def _names(task: TaskRecord, request: PredictRequest) -> Sequence[str]:
    """The task's objects; those of the request where no demonstration has said which they are."""
    return task.object_names or list(dict.fromkeys(query.name for query in request.objects))


def _with_points(
    request: PredictRequest, settings: TaskSettings, poses: Sequence[ObjectPose]
) -> tuple[tuple[SeenObject, ...], list[Source]]:
    by_name = {query.name: query for query in settings.with_models(request.objects)}
    found = [object_points(by_name[pose.name], pose, request.frames) for pose in poses]
    objects = tuple(SeenObject(pose, points_m) for pose, (points_m, _) in zip(poses, found, strict=True))
    return objects, [source for _, source in found]


def _assumed(poses: Sequence[ObjectPose], sources: Sequence[Source]) -> Iterator[Finding]:
    names = [pose.name for pose, source in zip(poses, sources, strict=True) if source == "assumed"]
    if names:
        message = (
            f"Nothing is known of the size of {', '.join(names)}: programs see a ball of {100 * ASSUMED_RADIUS_M:g} cm "
            "radius. Masks with depth, or a cuboid in the task's object_models, would show more."
        )
        yield Finding("assumed-size", "info", message, "objects")
