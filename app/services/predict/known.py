"""What the store knows of a request, read in one transaction: task, settings, the step before, and demonstrations."""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.pipeline.findings import Finding
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.plans import agreeing
from app.pipeline.plans.choice import PlanChoice, PlanChooser
from app.pipeline.prompt import check_object_names
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.measures import timed
from app.services.pose_servers import PoseServers
from app.services.predict.closed_loop import PreviousStep, previous_step
from app.services.predict.observe import Scene, look, observed
from app.services.predict.prefix import Prefix, PrefixKey, PromptStyle, make_prefix
from app.services.predict.request import PredictOptions, PredictRequest
from app.services.predict.select import (
    Demonstrations,
    DemonstrationSelector,
    TaskState,
    read_compared,
    read_demonstrations,
    read_hands,
)
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import TaskRecord
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion_limits import Pose

MAX_PREFIXES = 256  # that are kept
MAX_READ = 16  # sets of demonstrations: what was read for one purpose is soon wanted for another
MAX_TAUGHT = 128  # tasks whose demonstrations are kept
MAX_PLANS = 128  # sets of demonstrations whose plans are kept
MAX_HELD_AGAINST = 50  # demonstrations of a task


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of a request before its question is written.

    Attributes:
        scene: as it was observed.
        end_effector: where it is before the first action: as the robot tells, else where the last step sent it.
        prefixes: one for all samples, or one for each.
        taught: all demonstrations of the task, which an answer is held against.
        plan_findings: which of the demonstrated plans the first shows, and why.
    """

    settings: TaskSettings
    previous: PreviousStep | None
    end_effector: Pose | None
    scene: Scene
    profile: ModelProfile
    style: PromptStyle
    prefixes: Sequence[Prefix]
    taught: Taught
    plan_findings: tuple[Finding, ...] = ()


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
        self._select = DemonstrationSelector()
        self._prefixes: Cache[PrefixKey, Prefix] = Cache(MAX_PREFIXES)
        self._demonstrations: Cache[tuple[*TaskState, tuple[str, ...]], Demonstrations] = Cache(MAX_READ)
        self._all: Cache[tuple[*TaskState, bool, bool], Taught] = Cache(MAX_TAUGHT)
        self._needed: Cache[tuple[*TaskState, tuple[str, ...]], frozenset[str]] = Cache(MAX_PLANS)
        self._plans: Cache[tuple[*TaskState, tuple[str, ...]], PlanChooser] = Cache(MAX_PLANS)

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
                task = tasks.get(connection, request.task)
                settings = TaskSettings.model_validate(task.settings)
                previous = previous_step(connection, request)
            end_effector = request.end_effector or (previous.end_effector if previous else None)
            settings.limits_of_motion().require_start(end_effector)
            with timed("poses"):
                blobs = self._store.blobs
                scene = observed(request, task, settings, blobs) if seen is None else seen.scene_of(task)
            with timed("prompt"):
                profile = self.profile_of(previous.model if previous else request.options.model)
                style = previous.style if previous else PromptStyle.of(request, settings, profile)
                taught = self._taught(connection, task, settings, style)
                ids = self._ids(connection, request, task, settings, scene, previous)
                if scene.absent:
                    taught = self._without_absent(connection, task, settings, scene, taught, ids)
                named = request.options.episode_ids is not None and previous is None
                asked = _Asked(task, settings, style, scene.absent, all_of_them=named)
                shown = [self._shown(connection, asked, order, scene) for order in _orders(ids, request.options)]
        prefixes, findings = [prefix for prefix, _ in shown], shown[0][1]
        return Known(settings, previous, end_effector, scene, profile, style, prefixes, taught, findings)

    def usual_prefixes(self, task_name: str) -> list[Prefix]:
        """What requests that name nothing but the task show in scenes of its usual plans, the most usual first.

        Raises:
            as for such a request.
        """
        request = PredictRequest(task_name, "", ())
        with self._store.read() as connection:
            task = tasks.get(connection, task_name)
            settings = TaskSettings.model_validate(task.settings)
            style = PromptStyle.of(request, settings, self.profile_of(None))
            self._taught(connection, task, settings, style)
            number = settings.num_demonstrations
            ids = self._select(connection, task, request.options.selection, number, request.options.seed, ())
            plans = self._plans_of(connection, task, settings, ids)
            choices = [None] if plans is None else plans.likely()
            asked = _Asked(task, settings, style)
            return [self._prefix(connection, asked, ids, choice) for choice in choices]

    def _taught(
        self,
        connection: Connection,
        task: TaskRecord,
        settings: TaskSettings,
        style: PromptStyle,
    ) -> Taught:
        """All demonstrations of the task, whichever the request names; of very many those that lie farthest apart.

        Those that a program names may be of one way by chance: the service cannot know that a person chose them.

        Raises:
            NoDemonstrationsError: if there is none, or all are left out.
        """

        def make() -> Taught:
            if not (ids := self._select(connection, task, "diverse", MAX_HELD_AGAINST, 0, ())):
                raise NoDemonstrationsError(task.name)
            recorded = self._read(connection, task, settings, ids).recorded
            hands = read_hands(connection, task.name, recorded, settings)
            if not style.from_start:
                recorded = tuple(replace(demonstration, start=None) for demonstration in recorded)
            return Taught(
                recorded,
                settings.ways == "several",
                hands,
                frozenset(settings.yaw_symmetry_deg),
                moves=style.closed_loop,
                compared=read_compared(connection, task.name, ids, settings),
            )

        key = (task.name, task.created_at, task.version, style.from_start, style.closed_loop)
        return self._all.get(key, make)

    def _read(
        self, connection: Connection, task: TaskRecord, settings: TaskSettings, ids: tuple[str, ...]
    ) -> Demonstrations:
        """The demonstrations of those ids; a prompt and what its answer is held against are often made of the same."""

        def make() -> Demonstrations:
            found = read_demonstrations(connection, task.name, ids, settings, all_of_them=True)
            return found.only(task.object_names or ())

        return self._demonstrations.get((task.name, task.created_at, task.version, ids), make)

    def _without_absent(
        self,
        connection: Connection,
        task: TaskRecord,
        settings: TaskSettings,
        scene: Scene,
        taught: Taught,
        ids: tuple[str, ...],
    ) -> Taught:
        """What is taught of scenes without the objects that are absent.

        Raises:
            ObjectSetError: if one of them may matter to all that is taught, or to the demonstrations of those ids.
        """
        key = (task.name, task.created_at, task.version, ids)
        shown = Taught(self._read(connection, task, settings, ids).recorded)
        needed = self._needed.get(key, lambda: taught.needed | shown.needed)
        present = [pose.name for pose in scene.objects]
        check_object_names(present, task.object_names or (), needed)
        return taught.of_objects(present)

    def _ids(
        self,
        connection: Connection,
        request: PredictRequest,
        task: TaskRecord,
        settings: TaskSettings,
        scene: Scene,
        previous: PreviousStep | None,
    ) -> tuple[str, ...]:
        """The demonstrations that the request names or its selection finds."""
        options = request.options
        if previous is not None:
            return previous.demonstration_ids
        if options.episode_ids is not None:
            _refuse_left_out(connection, options.episode_ids)
            return options.episode_ids
        number = options.num_demonstrations or settings.num_demonstrations
        return self._select(connection, task, options.selection, number, options.seed, scene.objects)

    def _shown(
        self, connection: Connection, asked: "_Asked", ids: tuple[str, ...], scene: Scene
    ) -> tuple[Prefix, tuple[Finding, ...]]:
        """Of several plans those that the scene calls for, and why, unless somebody chose the demonstrations."""
        by_scene = not (asked.all_of_them or asked.style.closed_loop)
        plans = self._plans_of(connection, asked.task, asked.settings, ids) if by_scene else None
        choice = None if plans is None else plans(scene.objects)
        return self._prefix(connection, asked, ids, choice), () if choice is None else choice.findings

    def _plans_of(
        self, connection: Connection, task: TaskRecord, settings: TaskSettings, ids: tuple[str, ...]
    ) -> PlanChooser | None:
        if not settings.keyframes.keyframe_rule().aligned:
            return None
        key = (task.name, task.created_at, task.version, ids)
        return self._plans.get(key, lambda: PlanChooser(self._read(connection, task, settings, ids).recorded))

    def _prefix(
        self, connection: Connection, asked: "_Asked", ids: tuple[str, ...], choice: PlanChoice | None
    ) -> Prefix:
        """The demonstrations of those ids, written down.

        Args:
            choice: those of them that the scene calls for.
        """
        task, settings, style = asked.task, asked.settings, asked.style
        shown_ids = () if choice is None else tuple(demonstration.id for demonstration in choice.shown)
        key = PrefixKey(task.name, task.version, style, ids, asked.all_of_them, shown_ids, asked.absent)

        def make() -> Prefix:
            if choice is not None:
                found = Demonstrations(agreeing(choice.shown), choice.shown)
            elif style.closed_loop:
                found = read_demonstrations(connection, task.name, ids, settings, stepwise=True)
            else:
                found = self._read(connection, task, settings, ids)
                if settings.keyframes.keyframe_rule().aligned and not asked.all_of_them:
                    found = found.without_rare_plans()
            return make_prefix(found.only(set(task.object_names or ()).difference(asked.absent)), settings, style)

        return self._prefixes.get(key, make)


def _refuse_left_out(connection: Connection, ids: Sequence[str]) -> None:
    """Refuse episodes that no prompt is to show.

    Raises:
        InvalidInputError: naming the first.
    """
    left_out = episodes.left_out_of(connection, ids)
    for number, id_ in enumerate(ids):
        if id_ in left_out:
            remedy = f'others, or PATCH /episodes/{id_} with {{"left_out": false}}'
            raise InvalidInputError(f"episode_ids[{number}]", f"{id_} is left out of prompts", remedy)


@dataclass(frozen=True, eq=False)
class _Asked:
    """How prompts of a request are written, whatever they show.

    Attributes:
        absent: objects of the task that the scene does not have.
        all_of_them: also demonstrations of a rare plan.
    """

    task: TaskRecord
    settings: TaskSettings
    style: PromptStyle
    absent: tuple[str, ...] = ()
    all_of_them: bool = False


def _orders(ids: tuple[str, ...], options: PredictOptions) -> list[tuple[str, ...]]:
    """The order of the demonstrations for each sample that has one of its own."""
    if not options.permute_demonstrations:
        return [ids]
    others = [random.Random(options.seed + k) for k in range(1, options.num_samples)]
    return [ids, *(tuple(other.sample(ids, len(ids))) for other in others)]
