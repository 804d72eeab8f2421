"""From a robot's request to the question for the LLM: demonstrations read, objects found, prompt written."""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.pipeline.language.similarity import Described
from app.pipeline.plans.support import PlacedPlan
from app.pipeline.representation import KAT_FORMAT
from app.services.cache import Cache
from app.services.limits import Limits
from app.services.measures import Timings, timed
from app.services.pose_servers import PoseServers
from app.services.predict.doubts import findings_before
from app.services.predict.instruction import ground_instruction, is_english
from app.services.predict.observe import look, object_names, observed
from app.services.predict.others import other_tasks, read_other_tasks
from app.services.predict.program_question import ProgramQuestionWriter
from app.services.predict.question import PredictRequest, Question
from app.services.predict.select import DemonstrationSelector, read_demonstrations, stepwise_demonstrations
from app.services.predict.template import (
    CAPACITY,
    PreviousStep,
    PromptStyle,
    Template,
    TemplateKey,
    make_other_tasks_template,
    make_template,
    previous_step,
)
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import TaskRecord
from app.store.store import Store
from roboprompt_client.trajectory import ObjectPose
from roboprompt_client.wording import checked_instruction

SEEDS = 2**31  # the most that every backend takes


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
        self._write_program = ProgramQuestionWriter(store, profile_of, self._pose_servers)
        self._select = DemonstrationSelector()
        self._templates: Cache[TemplateKey, Template] = Cache(CAPACITY)
        is_english("")  # reads its list now, so that no request waits for it

    def __call__(self, request: PredictRequest, timings_ms: Timings) -> Question:
        """The question that `request` puts to its model.

        Raises:
            UnknownModelError: for an unknown model.
            NotFoundError: for an unknown task, episode or prediction.
            NoDemonstrationsError: if the task has no episode yet.
            ConflictError: if a closed loop's demonstrations have changed since its last step, or the task's settings
                while its images were looked at.
            InvalidInputError, ObjectSetError: if the observation does not fit the task.
            UngroundedInstructionError, UnfamiliarInstructionError: if the instruction is not clear.
        """
        if request.options.method == "voxposer":
            return self._write_program(request, timings_ms)
        instruction = checked_instruction("instruction", request.instruction)
        seen = look(self._store, self._pose_servers, request, timings_ms) if request.frames else None
        with self._store.read() as connection:
            with timed(timings_ms, "read"):
                task = tasks.get(connection, request.task)
                settings = TaskSettings.model_validate(task.settings)
                after = request.options.after
                previous = None if after is None else previous_step(connection, after, request.task)
            end_effector = request.end_effector or (None if previous is None else previous.end_effector)
            settings.limits_of_motion().require_start(end_effector)
            if seen is None:
                with timed(timings_ms, "poses"):
                    objects = observed(request, settings, object_names(request, task), self._store.blobs)
            else:
                objects = seen.objects_of(task)
            with timed(timings_ms, "prompt"):
                chosen = self._chosen(connection, request, task, settings, objects, previous)
        template, style = chosen.templates[0], chosen.style
        with timed(timings_ms, "words"):
            grounded = ground_instruction(request, instruction, template.instructions, settings, objects, previous)
        step = None if not style.closed_loop else 0 if previous is None else previous.step + 1
        written = template.at_step(step or 0).in_scene(objects)
        so_far = "" if previous is None else previous.so_far(template)
        self._limits.check_prompt(len(written.system) + len(written.prefix) + len(so_far))
        question = Question(
            request=request,
            grounded=grounded,
            instructions=written.codec.questions(grounded.instruction),
            objects=written.posed(objects),
            template=template,
            written=written,
            so_far=so_far,
            step=step,
            profile=chosen.profile,
            style=style,
            settings=settings,
            observed=objects,
            end_effector=end_effector,
        )
        question = replace(question, plans=_placed(question))
        question = replace(question, findings=findings_before(question))
        if request.options.num_samples == 1:
            return question
        return replace(question, samples=_samples(question, chosen.templates))

    def model_of(self, request: PredictRequest) -> str:
        """The name of the model that `request` asks; raises UnknownModelError."""
        return self._profile_of(request.options.model).name

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

    def _chosen(
        self,
        connection: Connection,
        request: PredictRequest,
        task: TaskRecord,
        settings: TaskSettings,
        objects: Sequence[ObjectPose],
        previous: PreviousStep | None,
    ) -> "_Chosen":
        """As the request asks; a closed loop goes on as it began."""
        profile = self._profile_of(request.options.model if previous is None else previous.model)
        if request.options.demonstrations_from is not None:
            style = _style(request, settings, profile)
            return _Chosen(profile, style, self._of_other_tasks(connection, request, task, settings, style, objects))
        if previous is None:
            style = _style(request, settings, profile)
            ids = self._demonstration_ids(connection, request, task, settings, objects)
        else:
            style, ids = previous.style, previous.demonstration_ids
        orders = _orders(ids, request)
        named = request.options.episode_ids is not None
        templates = [self._template(connection, task, settings, style, order, all_of_them=named) for order in orders]
        return _Chosen(profile, style, templates)

    def _of_other_tasks(
        self,
        connection: Connection,
        request: PredictRequest,
        task: TaskRecord,
        settings: TaskSettings,
        style: PromptStyle,
        objects: Sequence[ObjectPose],
    ) -> list[Template]:
        """What other tasks demonstrate, one template for all samples or one for each."""
        asked = Described(request.instruction, tuple(pose.name for pose in objects))
        number = request.options.num_demonstrations or settings.num_demonstrations
        lending = other_tasks(connection, asked, task, request.options, number, self._select)
        versions = tuple((other.record.name, other.record.version) for other in lending)

        def template(ids: tuple[str, ...]) -> Template:
            def make() -> Template:
                read = read_other_tasks(connection, lending, task, settings)
                return make_other_tasks_template(read, ids, settings, style)

            key = TemplateKey(task.name, task.version, style, ids, other_tasks=versions)
            return self._templates.get(key, make)

        return [template(ids) for ids in _orders(tuple(id_ for other in lending for id_ in other.ids), request)]

    def _demonstration_ids(
        self,
        connection: Connection,
        request: PredictRequest,
        task: TaskRecord,
        settings: TaskSettings,
        objects: Sequence[ObjectPose],
    ) -> tuple[str, ...]:
        """Those that the request names, or that its selection finds."""
        if request.options.episode_ids is not None:
            return request.options.episode_ids
        number = request.options.num_demonstrations or settings.num_demonstrations
        return self._select(connection, task, request.options.selection, number, request.options.seed, objects)

    def _template(
        self,
        connection: Connection,
        task: TaskRecord,
        settings: TaskSettings,
        style: PromptStyle,
        ids: tuple[str, ...],
        *,
        all_of_them: bool = False,
    ) -> Template:
        """The demonstrations of those ids, written down.

        Args:
            all_of_them: also those of a rare plan.
        """
        key = TemplateKey(task.name, task.version, style, ids, all_of_them)

        def make() -> Template:
            if style.closed_loop:
                records = episodes.demonstrations_by_id(connection, task.name, ids)
                return make_template(stepwise_demonstrations(records, settings), settings, style)
            read = read_demonstrations(connection, task.name, ids, settings, all_of_them=all_of_them)
            return make_template(read, settings, style)

        return self._templates.get(key, make)


def _placed(question: Question) -> dict[str, tuple[PlacedPlan, ...] | None]:
    """The demonstrated rows in the observed scene, for each part of the instruction."""
    if (support := question.template.support) is None:
        return {}
    return {part: support.placed(question.objects, part, question.start) for part in question.instructions}


def _orders(ids: tuple[str, ...], request: PredictRequest) -> list[tuple[str, ...]]:
    """The order of the demonstrations for each sample that has one of its own."""
    if not request.options.permute_demonstrations:
        return [ids]
    others = [random.Random(request.options.seed + k) for k in range(1, request.options.num_samples)]
    return [ids, *(tuple(other.sample(ids, len(ids))) for other in others)]


def _samples(question: Question, templates: Sequence[Template]) -> tuple[Question, ...]:
    """The question once for each sample.

    Args:
        templates: one for all, or one for each.
    """
    request = question.request
    own = templates if len(templates) > 1 else [*templates] * request.options.num_samples
    return tuple(
        replace(
            question,
            request=request.with_options(seed=(request.options.seed + k) % SEEDS),
            template=template,
            written=template.at_step(0).in_scene(question.objects),
        )
        for k, template in enumerate(own)
    )


@dataclass(frozen=True, eq=False)
class _Chosen:
    """Which model is asked, and the demonstrations that it reads.

    Attributes:
        templates: one for all samples, or one for each.
    """

    profile: ModelProfile
    style: PromptStyle
    templates: Sequence[Template]


def _style(request: PredictRequest, settings: TaskSettings, profile: ModelProfile) -> PromptStyle:
    """What the request says, else the task's setting, else what suits the model."""
    representation = request.options.representation or settings.representation or profile.representation
    prompt_format = request.options.prompt_format or settings.prompt_format or profile.prompt_format
    system_prompt = request.options.system_prompt or settings.system_prompt
    if system_prompt is None:
        system_prompt = _suitable_system_prompt(representation, prompt_format, profile)
    started = request.end_effector is not None and not request.options.closed_loop
    return PromptStyle(representation, prompt_format, system_prompt, request.options.closed_loop, started)


def _suitable_system_prompt(representation: str, prompt_format: str, profile: ModelProfile) -> str:
    """The one that describes the prompt: the paper's are about lists of actions; who continues text needs none."""
    if profile.style != "chat" or representation == "object_frame":
        return "none"
    return "kat" if prompt_format == KAT_FORMAT else profile.system_prompt
