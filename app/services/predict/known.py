"""What the store knows of a request, read in one transaction: task, settings, the step before, and demonstrations."""

from collections.abc import Callable
from dataclasses import dataclass

from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.order.order import Order
from app.pipeline.prompt import check_object_names
from app.services.measures import timed
from app.services.pose_servers import PoseServers
from app.services.predict.demonstrations import Demonstrations
from app.services.predict.observe import Scene, look, observed
from app.services.predict.request import PredictRequest, PromptStyle
from app.services.predict.task_reading import Caches, TaskReading
from app.services.task_settings import TaskSettings
from app.store import predictions
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose, Pose


@dataclass(frozen=True)
class PreviousStep:
    """A closed loop's last prediction.

    Attributes:
        step: its number, from 0.
        prompt_user, reply_text: as the LLM read and wrote them.
        end_effector: where its action sent it.
        instruction, grounded: as it was asked, and how it was understood.
        objects: as they were observed.
    """

    step: int
    model: str
    style: PromptStyle
    demonstration_ids: tuple[str, ...]
    prompt_user: str
    reply_text: str
    end_effector: Pose
    instruction: str
    grounded: Order
    objects: tuple[ObjectPose, ...] = ()


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of a request before its question is written.

    Attributes:
        settings: of the task.
        previous: the step that a closed loop goes on from.
        end_effector: where it is before the first action: as the robot says, else where the last step sent it.
        scene: as it was observed.
        profile: of the model that is asked.
        demonstrations: that the request names or its selection finds.
        chosen: whether the request names them.
        taught: all demonstrations of the task, which an answer is held against.
    """

    settings: TaskSettings
    previous: PreviousStep | None
    end_effector: Pose | None
    scene: Scene
    profile: ModelProfile
    style: PromptStyle
    demonstrations: Demonstrations
    chosen: bool
    taught: Taught

    @property
    def step(self) -> int | None:
        """The number of a closed loop's step that is asked for, from 0; None without one."""
        if self.previous is not None:
            return self.previous.step + 1
        return 0 if self.style.closed_loop else None


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
        self._caches: Caches = {}

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
                task = TaskReading(connection, request.task, self._caches)
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
                taught = task.taught(style.from_start, style.closed_loop)
                ids = _ids(task, request, scene, previous)
                demonstrations = task.stepwise(ids) if style.closed_loop else task.demonstrations(ids)
        if scene.absent:
            present = [pose.name for pose in scene.objects]
            check_object_names(present, task.record.object_names or (), taught.needed | demonstrations.needed)
            taught = taught.of_objects(present)
        return Known(
            settings,
            previous,
            end_effector,
            scene,
            profile,
            style,
            demonstrations,
            chosen=request.options.episode_ids is not None and previous is None,
            taught=taught,
        )

    def usual(self, task_name: str) -> tuple[Demonstrations, TaskSettings, PromptStyle]:
        """What requests that name nothing but the task show.

        Raises:
            as for such a request.
        """
        request = PredictRequest(task_name, "", ())
        with self._store.read() as connection:
            task = TaskReading(connection, task_name, self._caches)
            style = PromptStyle.of(request, task.settings, self.profile_of(None))
            task.taught(style.from_start, style.closed_loop)  # an answer needs it next
            return task.demonstrations(_ids(task, request)), task.settings, style


def previous_step(connection: Connection, request: PredictRequest) -> PreviousStep | None:
    """The prediction that a closed loop goes on from; None for a request that begins.

    Raises:
        NotFoundError: if there is no such prediction.
        InvalidInputError: if it is none that a closed loop of this task can go on from.
    """
    if request.options.after is None:
        return None
    record = predictions.get(connection, request.options.after)
    valid = "the id of the last step of a closed loop that goes on"
    if record.task != request.task:
        raise InvalidInputError("after", f"is a prediction of the task {record.task!r}", valid)
    if record.step is None or record.reply_text is None or record.actions is None:
        raise InvalidInputError("after", "is not a step of a closed loop that gave an action", valid)
    if not record.actions:
        raise InvalidInputError("after", "is a step that ended its closed loop", valid)
    last = record.actions[-1]
    return PreviousStep(
        record.step,
        record.model,
        PromptStyle(record.representation, record.prompt_format, record.prompt_system, closed_loop=True),
        record.demonstration_ids,
        record.prompt_user,
        record.reply_text,
        Pose(tuple(last["position"]), tuple(last["quaternion_xyzw"])),
        record.instruction,
        Order.from_json(record.grounding, [item.name for item in record.objects]),
        tuple(item.pose() for item in record.objects),
    )


def _ids(
    task: TaskReading, request: PredictRequest, scene: Scene | None = None, previous: PreviousStep | None = None
) -> tuple[str, ...]:
    """The demonstrations that the request names or its selection finds."""
    options = request.options
    if previous is not None:
        return previous.demonstration_ids
    if options.episode_ids is not None:
        task.refuse_left_out(options.episode_ids)
        return options.episode_ids
    number = options.num_demonstrations or task.settings.num_demonstrations
    return task.ids(options.selection, number, options.seed, () if scene is None else scene.objects)
