"""From a robot's request to the question for the LLM: demonstrations read, objects found, prompt written."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.perception.base import ObjectQuery
from app.perception.frames import ImageBytes
from app.perception.registry import estimate_poses
from app.pipeline.episode import ObjectPose, RgbdFrame, checked_instruction
from app.pipeline.motion_limits import Pose
from app.pipeline.prompt import Prompt, PromptTemplate, check_object_names, objects_of_task
from app.pipeline.reply import MAX_ACTIONS
from app.pipeline.representation import KAT_FORMAT
from app.services.errors import NoDemonstrationsError
from app.services.previous_step import PreviousStep, previous_step
from app.services.select_demonstrations import Selection, load_demonstrations
from app.services.task_settings import TaskSettings
from app.services.templates import PromptStyle, Template, TemplateCache, TemplateKey, make_template
from app.services.timing import Timings, timed
from app.store import episodes, tasks
from app.store.errors import ConflictError
from app.store.records import DemonstrationRecord, TaskRecord
from app.store.store import Store
from app.store.values import JsonObject


@dataclass(frozen=True)
class PredictRequest:
    """What a robot asks.

    Attributes:
        objects: the observed objects, in any order.
        frames: calibrated images, for estimators that look.
        images: the same as they came, by camera, to be stored with the prediction.
        model, representation, prompt_format, system_prompt, num_demonstrations: None follows the task, then the model.
        episode_ids: exactly these demonstrations, in this order, instead of a selection.
        closed_loop: ask for the next action only.
        after: the id of the prediction that a closed loop goes on from; its model, demonstrations and style go on, too.
        end_effector: where the robot's end effector is, where the robot tells.
        as_sent: the request as it came, to be stored with the prediction.
    """

    task: str
    instruction: str
    objects: tuple[ObjectQuery, ...]
    frames: tuple[RgbdFrame, ...] = ()
    images: Mapping[str, ImageBytes] = field(default_factory=dict)
    model: str | None = None
    representation: str | None = None
    prompt_format: str | None = None
    system_prompt: str | None = None
    num_demonstrations: int | None = None
    selection: Selection = "first"
    seed: int = 0
    episode_ids: tuple[str, ...] | None = None
    closed_loop: bool = False
    after: str | None = None
    max_actions: int = MAX_ACTIONS
    timeout_s: float = 60.0
    end_effector: Pose | None = None
    as_sent: JsonObject = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Question:
    """Everything that is fixed before the LLM is asked.

    Attributes:
        instructions: to ask for one after the other.
        written: the template at the step that is asked for.
        so_far: the steps of a closed loop that were taken already.
        step: of a closed loop, from 0; None without one.
        observed: the objects as they were found, in the task's order.
        end_effector: where it is before the first action: as the robot tells, else where the last step sent it.
    """

    request: PredictRequest
    instructions: tuple[str, ...]
    objects: tuple[ObjectPose, ...]
    template: Template
    written: PromptTemplate
    so_far: str
    step: int | None
    profile: ModelProfile
    style: PromptStyle
    settings: TaskSettings
    observed: tuple[ObjectPose, ...]
    end_effector: Pose | None

    @property
    def prompt(self) -> Prompt:
        """The prompt that asks for the first of the instructions."""
        return self.written.ask(self.objects, self.instructions[0], self.request.max_actions, self.so_far)


class QuestionWriter:
    """Writes questions; keeps what does not depend on the request. Synchronous: call it in a thread.

    Args:
        profile_of: the profile of a model by its name, of the default for None; raises UnknownModelError.
    """

    def __init__(self, store: Store, profile_of: Callable[[str | None], ModelProfile]) -> None:
        self._store = store
        self._profile_of = profile_of
        self._templates = TemplateCache()

    def __call__(self, request: PredictRequest, timings_ms: Timings) -> Question:
        """The question that `request` puts to its model.

        Raises:
            UnknownModelError: for an unknown model.
            NotFoundError: for an unknown task, episode or prediction.
            NoDemonstrationsError: if the task has no episode yet.
            ConflictError: if a closed loop's demonstrations have changed since its last step, or the task's settings
                while its images were looked at.
            InvalidInputError, ObjectSetError: if the observation does not fit the task.
        """
        instruction = checked_instruction("instruction", request.instruction)
        seen = self._look(request, timings_ms) if request.frames else None
        with self._store.read() as connection:
            with timed(timings_ms, "read"):
                task = tasks.get(connection, request.task)
                settings = TaskSettings.model_validate(task.settings)
                previous = None if request.after is None else previous_step(connection, request.after, request.task)
            if seen is None:
                with timed(timings_ms, "poses"):
                    objects = _observed(request, task, settings)
            else:
                objects = seen.objects_of(task)
            with timed(timings_ms, "prompt"):
                profile = self._profile_of(request.model if previous is None else previous.model)
                style = _style(request, settings, profile) if previous is None else previous.style
                template = self._template(connection, request, task, settings, style, objects, previous)
        step = None if not style.closed_loop else 0 if previous is None else previous.step + 1
        written = template.at_step(step or 0)
        return Question(
            request=request,
            instructions=written.codec.questions(instruction),
            objects=written.posed(objects),
            template=template,
            written=written,
            so_far="" if previous is None else previous.so_far(template),
            step=step,
            profile=profile,
            style=style,
            settings=settings,
            observed=objects,
            end_effector=request.end_effector or (None if previous is None else previous.end_effector),
        )

    def _look(self, request: PredictRequest, timings_ms: Timings) -> "_Seen":
        """What the images show, found without a transaction open: a server may be asked."""
        with timed(timings_ms, "read"), self._store.read() as connection:
            task = tasks.get(connection, request.task)
        with timed(timings_ms, "poses"):
            return _Seen(task, _observed(request, task, TaskSettings.model_validate(task.settings)))

    def _template(
        self,
        connection: Connection,
        request: PredictRequest,
        task: TaskRecord,
        settings: TaskSettings,
        style: PromptStyle,
        objects: Sequence[ObjectPose],
        previous: PreviousStep | None,
    ) -> Template:
        if previous is not None:
            request = replace(request, episode_ids=previous.demonstration_ids)
        load, which = _demonstrations(connection, request, task.name, settings, objects)
        key = TemplateKey(task.name, task.version, style, which)
        return self._templates.get(key, lambda: make_template([r.demonstration() for r in load()], settings, style))


def _demonstrations(
    connection: Connection,
    request: PredictRequest,
    task: str,
    settings: TaskSettings,
    objects: Sequence[ObjectPose],
) -> tuple[Callable[[], Sequence[DemonstrationRecord]], tuple[str | int, ...]]:
    """How to load the request's demonstrations, and what identifies them within one version of the task."""
    ids = request.episode_ids
    if ids is not None:
        return lambda: episodes.demonstrations_by_id(connection, task, ids), ("ids", *ids)
    number = request.num_demonstrations or settings.num_demonstrations
    if request.selection == "nearest":
        nearest = load_demonstrations(connection, task, "nearest", number, request.seed, objects)
        return lambda: nearest, ("ids", *(record.id for record in nearest))
    selection, seed = request.selection, request.seed if request.selection == "random" else 0
    return lambda: load_demonstrations(connection, task, selection, number, seed, objects), (selection, number, seed)


@dataclass(frozen=True, eq=False)
class _Seen:
    """The objects that were found with the settings of `task`."""

    task: TaskRecord
    objects: tuple[ObjectPose, ...]

    def objects_of(self, task: TaskRecord) -> tuple[ObjectPose, ...]:
        """The objects, if `task` still wants them found so."""
        if (task.settings, task.object_names) != (self.task.settings, self.task.object_names):
            raise ConflictError(f"task {task.name!r} changed while its images were looked at: send the request again")
        return self.objects


def _observed(request: PredictRequest, task: TaskRecord, settings: TaskSettings) -> tuple[ObjectPose, ...]:
    """The observed objects' poses in the task's order, symmetric objects at their canonical yaw."""
    if task.object_names is None:
        raise NoDemonstrationsError(request.task)
    check_object_names([query.name for query in request.objects], task.object_names)
    poses = estimate_poses(settings.pose_estimator, settings.with_models(request.objects), request.frames)
    return settings.canonical(objects_of_task(poses, task.object_names))


def _style(request: PredictRequest, settings: TaskSettings, profile: ModelProfile) -> PromptStyle:
    """The request's wish, else the task's setting, else what suits the model."""
    representation = request.representation or settings.representation or profile.representation
    prompt_format = request.prompt_format or settings.prompt_format or profile.prompt_format
    system_prompt = request.system_prompt or settings.system_prompt
    if system_prompt is None:
        system_prompt = _suitable_system_prompt(representation, prompt_format, profile)
    return PromptStyle(representation, prompt_format, system_prompt, request.closed_loop)


def _suitable_system_prompt(representation: str, prompt_format: str, profile: ModelProfile) -> str:
    """The one that describes the prompt: the paper's are about lists of actions; who continues text needs none."""
    if profile.style != "chat" or representation == "object_frame":
        return "none"
    return "kat" if prompt_format == KAT_FORMAT else profile.system_prompt
