"""What the store knows of a request, read in one transaction: task, settings, the step before, and demonstrations."""

from collections.abc import Callable
from dataclasses import dataclass

from app.llm.base import ModelProfile
from app.pipeline.alike import alike_findings
from app.pipeline.findings import Finding
from app.pipeline.findings.arrangement import changed_places
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.scene import other_objects
from app.services.measures import timed
from app.services.pose_servers import PoseServers
from app.services.predict.closed_loop import PreviousStep, previous_step
from app.services.predict.observe import Scene, look, observed
from app.services.predict.prefix import Prefix
from app.services.predict.request import PredictRequest, PromptStyle
from app.services.predict.task_reading import Kept, TaskReading
from app.services.task_settings import TaskSettings
from app.store.store import Store
from roboprompt_client.motion_limits import Pose


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of a request before its question is written.

    Attributes:
        scene: as it was observed.
        end_effector: where it is before the first action: as the robot tells, else where the last step sent it.
        taught: all demonstrations of the task, which an answer is held against.
        findings: which of the demonstrated plans the first shows, and why; which objects are others than demonstrated.
    """

    settings: TaskSettings
    previous: PreviousStep | None
    end_effector: Pose | None
    scene: Scene
    profile: ModelProfile
    style: PromptStyle
    prefix: Prefix
    taught: Taught
    findings: tuple[Finding, ...] = ()


class KnownReader:
    """Reads what requests need; keeps what does not depend on the request. Synchronous: call it in a thread.

    Args:
        profile_of: the profile of a model by its name, of the default for None; raises UnknownModelError.
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
        self._kept = Kept()

    def __call__(self, request: PredictRequest) -> Known:
        """As the request asks; a closed loop goes on as it began.

        Raises:
            UnknownModelError: for an unknown model.
            NotFoundError: for an unknown task, episode or prediction.
            NoDemonstrationsError: if the task has no episode yet.
            ConflictError: if the task's settings changed while its images were looked at.
            InvalidInputError, ObjectSetError: if the observation does not fit the task.
        """
        seen = look(self._store, self._pose_servers, request) if request.frames else None
        with self._store.read() as connection:
            with timed("read"):
                task = TaskReading(connection, request.task, self._kept)
                previous = previous_step(connection, request)
            settings = task.settings
            end_effector = request.end_effector or (previous.end_effector if previous else None)
            settings.limits_of_motion().require_start(end_effector)
            with timed("poses"):
                if seen is None:
                    scene = observed(request, task.record, settings, self._store.blobs)
                else:
                    scene = seen.scene_of(task.record)
            with timed("prompt"):
                profile = self.profile_of(previous.model if previous else request.options.model)
                style = previous.style if previous else PromptStyle.of(request, settings, profile)
                taught, ids = task.taught(style), _ids(task, request, scene, previous)
                if scene.absent:
                    taught = task.taught_of([pose.name for pose in scene.objects], taught, ids)
                prefix, findings = _shown(task, request, style, scene, ids)
        others = other_objects(scene.absent, [pose.name for pose in scene.bystanders])
        moved = changed_places(previous.objects, scene.objects) if previous else ()
        findings = (*findings, *others, *moved, *alike_findings(request.alike))
        return Known(settings, previous, end_effector, scene, profile, style, prefix, taught, findings)

    def usual_prefixes(self, task_name: str) -> list[Prefix]:
        """What requests that name nothing but the task show in scenes of its usual plans, the most usual first.

        Raises:
            as for such a request.
        """
        request = PredictRequest(task_name, "", ())
        with self._store.read() as connection:
            task = TaskReading(connection, task_name, self._kept)
            style = PromptStyle.of(request, task.settings, self.profile_of(None))
            task.taught(style)
            ids = task.ids(request.options.selection, task.settings.num_demonstrations, request.options.seed, ())
            plans = task.plans(ids)
            return [task.prefix(style, ids, choice) for choice in ([None] if plans is None else plans.likely())]


def _ids(task: TaskReading, request: PredictRequest, scene: Scene, previous: PreviousStep | None) -> tuple[str, ...]:
    """The demonstrations that the request names or its selection finds."""
    options = request.options
    if previous is not None:
        return previous.demonstration_ids
    if options.episode_ids is not None:
        task.refuse_left_out(options.episode_ids)
        return options.episode_ids
    number = options.num_demonstrations or task.settings.num_demonstrations
    return task.ids(options.selection, number, options.seed, scene.objects)


def _shown(
    task: TaskReading, request: PredictRequest, style: PromptStyle, scene: Scene, ids: tuple[str, ...]
) -> tuple[Prefix, tuple[Finding, ...]]:
    """The demonstrations of those ids, and why it shows the plans that it shows.

    Of several plans those that the scene calls for, unless somebody chose the demonstrations.
    """
    named = request.options.episode_ids is not None and request.options.after is None
    plans = None if named or style.closed_loop else task.plans(ids)
    choice = None if plans is None else plans(scene.objects)
    prefix = task.prefix(style, ids, choice, scene.absent, all_of_them=named)
    return prefix, () if choice is None else choice.findings
