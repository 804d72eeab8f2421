"""From a robot's request to the question for the LLM: demonstrations read, objects found, prompt written."""

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.perception.base import ObjectQuery
from app.perception.frames import ImageBytes
from app.perception.registry import estimate_poses
from app.pipeline.episode import ObjectPose, RgbdFrame
from app.pipeline.errors import InvalidInputError
from app.pipeline.motion_limits import Pose
from app.pipeline.prompt import Prompt, PromptTemplate, check_object_names, objects_of_task
from app.pipeline.reply import MAX_ACTIONS
from app.pipeline.representation import KAT_FORMAT
from app.pipeline.wording import checked_instruction
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.limits import Limits
from app.services.pose_servers import PoseServers
from app.services.previous_step import previous_step
from app.services.select_demonstrations import DemonstrationSelector, Selection
from app.services.task_settings import TaskSettings
from app.services.templates import CAPACITY, PromptStyle, Template, TemplateKey, make_template
from app.services.timing import Timings, timed
from app.store import episodes, tasks
from app.store.errors import ConflictError
from app.store.records import TaskRecord
from app.store.store import Store
from app.store.values import JsonObject

SAMPLES_TEMPERATURE = 0.5
SEEDS = 2**31  # the most that every backend takes


@dataclass(frozen=True)
class PredictRequest:
    """What a robot asks.

    Attributes:
        objects: the observed objects, in any order.
        frames: calibrated images, for estimators that look.
        images: the same as they came, by camera, to be stored with the prediction.
        model, representation, prompt_format, system_prompt, num_demonstrations: None follows the task, then the model.
        num_samples: so many replies are asked for; the prediction is their median.
        temperature: None: greedy where there is nothing to vary otherwise.
        permute_demonstrations: each sample but the first sees the demonstrations in an order of its own.
        episode_ids: exactly these demonstrations, in this order, instead of a selection.
        closed_loop: ask for the next action only.
        after: the id of the prediction that a closed loop goes on from; its model, demonstrations and style go on, too.
        end_effector: where the robot's end effector is, where the robot tells.
        stream_text: hand out the reply's text, too, where it is read while it arrives.
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
    num_samples: int = 1
    temperature: float | None = None
    permute_demonstrations: bool = False
    episode_ids: tuple[str, ...] | None = None
    closed_loop: bool = False
    after: str | None = None
    max_actions: int = MAX_ACTIONS
    timeout_s: float = 60.0
    end_effector: Pose | None = None
    stream_text: bool = False
    as_sent: JsonObject = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.num_samples > 1 and (self.closed_loop or self.after is not None):
            raise InvalidInputError("num_samples", f"is {self.num_samples} in a closed loop", "1")

    @property
    def sampling_temperature(self) -> float:
        """As asked for; several samples of the same prompt must differ."""
        if self.temperature is not None:
            return self.temperature
        return 0.0 if self.num_samples == 1 or self.permute_demonstrations else SAMPLES_TEMPERATURE


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
        samples: where several replies are asked for, the same question for each, with a seed of its own.
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
    samples: tuple["Question", ...] = ()

    @cached_property
    def prompt(self) -> Prompt:
        """The prompt that asks for the first of the instructions."""
        return self.written.ask(self.objects, self.instructions[0], self.request.max_actions, self.so_far)


class QuestionWriter:
    """Writes questions; keeps what does not depend on the request. Synchronous: call it in a thread.

    Args:
        profile_of: the profile of a model by its name, of the default for None; raises UnknownModelError.
    """

    def __init__(
        self,
        store: Store,
        profile_of: Callable[[str | None], ModelProfile],
        limits: Limits | None = None,
        pose_servers: PoseServers | None = None,
    ) -> None:
        self._store = store
        self._limits = limits or Limits()
        self._pose_servers = pose_servers or PoseServers()
        self._profile_of = profile_of
        self._select = DemonstrationSelector()
        self._templates: Cache[TemplateKey, Template] = Cache(CAPACITY)

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
                if previous is None:
                    ids = self._demonstration_ids(connection, request, task, settings, objects)
                else:
                    ids = previous.demonstration_ids
                orders = _orders(ids, request)
                templates = [self._template(connection, task, settings, style, order) for order in orders]
        template = templates[0]
        step = None if not style.closed_loop else 0 if previous is None else previous.step + 1
        written = template.at_step(step or 0)
        so_far = "" if previous is None else previous.so_far(template)
        self._limits.check_prompt(len(written.system) + len(written.prefix) + len(so_far))
        question = Question(
            request=request,
            instructions=written.codec.questions(instruction),
            objects=written.posed(objects),
            template=template,
            written=written,
            so_far=so_far,
            step=step,
            profile=profile,
            style=style,
            settings=settings,
            observed=objects,
            end_effector=request.end_effector or (None if previous is None else previous.end_effector),
        )
        return replace(question, samples=_samples(question, templates)) if request.num_samples > 1 else question

    def usual_template(self, task_name: str) -> Template:
        """The template of a request that names nothing but the task.

        Raises:
            as for such a request.
        """
        request = PredictRequest(task_name, "", ())
        with self._store.read() as connection:
            task = tasks.get(connection, task_name)
            settings = TaskSettings.model_validate(task.settings)
            style = _style(request, settings, self._profile_of(None))
            ids = self._demonstration_ids(connection, request, task, settings, ())
            return self._template(connection, task, settings, style, ids)

    def _look(self, request: PredictRequest, timings_ms: Timings) -> "_Seen":
        """What the images show, found without a transaction open: a server may be asked."""
        with timed(timings_ms, "read"), self._store.read() as connection:
            task = tasks.get(connection, request.task)
        settings = TaskSettings.model_validate(task.settings)
        self._pose_servers.check(settings.object_models)
        with timed(timings_ms, "poses"):
            return _Seen(task, _observed(request, task, settings))

    def _demonstration_ids(
        self,
        connection: Connection,
        request: PredictRequest,
        task: TaskRecord,
        settings: TaskSettings,
        objects: Sequence[ObjectPose],
    ) -> tuple[str, ...]:
        """Those that the request names, or that its selection finds."""
        if request.episode_ids is not None:
            return request.episode_ids
        number = request.num_demonstrations or settings.num_demonstrations
        return self._select(connection, task, request.selection, number, request.seed, objects)

    def _template(
        self,
        connection: Connection,
        task: TaskRecord,
        settings: TaskSettings,
        style: PromptStyle,
        ids: tuple[str, ...],
    ) -> Template:
        """The demonstrations of those ids, written down."""
        key = TemplateKey(task.name, task.version, style, ids)

        def make() -> Template:
            records = episodes.demonstrations_by_id(connection, task.name, ids)
            return make_template([record.demonstration() for record in records], settings, style)

        return self._templates.get(key, make)


def _orders(ids: tuple[str, ...], request: PredictRequest) -> list[tuple[str, ...]]:
    """The order of the demonstrations for each sample that has one of its own."""
    if not request.permute_demonstrations:
        return [ids]
    others = [random.Random(request.seed + k) for k in range(1, request.num_samples)]
    return [ids, *(tuple(other.sample(ids, len(ids))) for other in others)]


def _samples(question: Question, templates: Sequence[Template]) -> tuple[Question, ...]:
    """The question once for each sample.

    Args:
        templates: one for all, or one for each.
    """
    request = question.request
    own = templates if len(templates) > 1 else [*templates] * request.num_samples
    return tuple(
        replace(
            question,
            request=replace(request, seed=(request.seed + k) % SEEDS),
            template=template,
            written=template.at_step(0),
        )
        for k, template in enumerate(own)
    )


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
