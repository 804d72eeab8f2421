"""What the store knows of a request, read in one transaction: task, settings and demonstrations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.prompt import check_object_names
from app.services.measures import timed
from app.services.pose_servers import PoseServers
from app.services.predict.demonstrations import Demonstrations
from app.services.predict.observe import Scene, look, observed
from app.services.predict.request import PredictRequest, PromptStyle
from app.services.predict.task_reading import TaskCaches, TaskReading
from app.services.task_settings import TaskSettings
from app.store.store import Store
from roboprompt_client.types.poses import Pose


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
    """

    settings: TaskSettings
    end_effector: Pose | None
    scene: Scene
    profile: ModelProfile
    style: PromptStyle
    demonstrations: Demonstrations
    chosen: bool
    taught: Taught


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

        Raises:
            UnknownModelError: for an unknown model.
            NotFoundError: for an unknown task or episode.
            NoDemonstrationsError: if the task has no episode yet.
            ConflictError: if the task's settings changed while its images were looked at.
            InvalidInputError, ObjectSetError: if the observation does not fit the task.
        """
        seen = look(self._store, self._pose_servers, request) if request.frames else None
        with self._store.read() as connection:
            with timed("read"):
                task = TaskReading(connection, request.task, self._caches)
            settings = task.settings
            settings.limits_of_motion().require_start(request.end_effector)
            with timed("poses"):
                if seen is None:
                    scene = observed(request, task.record, settings, self._store.blobs)
                else:
                    scene = seen.scene_of(task.record)
            with timed("prompt"):
                profile = self.profile_of(request.options.model)
                style = PromptStyle.of(request, settings, profile)
                taught = task.taught(style.from_start)
                demonstrations = task.demonstrations(_ids(task, request, scene))
        if scene.absent:
            present = [pose.name for pose in scene.objects]
            check_object_names(present, task.record.object_names or (), taught.needed | demonstrations.needed)
            taught = taught.of_objects(present)
        return Known(
            settings,
            request.end_effector,
            scene,
            profile,
            style,
            demonstrations,
            chosen=request.options.episode_ids is not None,
            taught=taught,
        )

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
            return task.demonstrations(_ids(task, request)), task.settings, style


def _ids(task: TaskReading, request: PredictRequest, scene: Scene | None = None) -> tuple[str, ...]:
    """Return the ids of the demonstrations that the request names, or that its selection finds."""
    options = request.options
    if options.episode_ids is not None:
        task.refuse_left_out(options.episode_ids)
        return options.episode_ids
    number = options.num_demonstrations or task.settings.num_demonstrations
    return task.ids(options.selection, number, options.seed, () if scene is None else scene.objects)
