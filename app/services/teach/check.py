"""A task's demonstrations, each predicted from the others before a robot moves; by an LLM where one is named."""

import threading
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, replace

import anyio
import anyio.to_thread
from sqlalchemy import Connection

from app.llm.base import ModelProfile
from app.perception.base import ObjectQuery
from app.pipeline.check import check_demonstrations
from app.pipeline.check.report import EpisodeCheck, ReplyCheck, TaskCheck, check_reply, reply_findings
from app.pipeline.episode import Demonstration
from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.plans.symmetry import folded, shown_symmetries, symmetry_findings
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.extract import reading
from app.services.predict.demonstrations import recordings_of
from app.services.predict.record import Prediction
from app.services.predict.request import PredictOptions, PredictRequest
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import TaskRecord, TaskState
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError, UnsafeActionError
from roboprompt_client.types.poses import Pose

MAX_CHECKED = 30  # demonstrations, the task's first; prompts have 10 unless somebody wants more
MAX_ASKED = 10  # of them that an LLM is asked about, some seconds each
ASKED_TIMEOUT_S = 120.0  # each; no robot waits
KEPT = 32  # checks of tasks that have not changed since
REFUSALS = (ReplyParseError, UnsafeActionError, UnsupportedActionError, InvalidInputError)


Predict = Callable[[PredictRequest], Awaitable[Prediction]]


@dataclass(frozen=True, eq=False)
class CheckedTask:
    """The result of a check.

    Attributes:
        num_episodes: that the task has; the first `MAX_CHECKED` are checked.
        model: that was asked; None if none was.
        replies: of the first `MAX_ASKED` demonstrations that prompts show; empty without a model.
        findings: the severest first.
    """

    task: str
    num_episodes: int
    check: TaskCheck
    findings: tuple[Finding, ...]
    model: str | None = None
    replies: tuple[ReplyCheck, ...] = ()


@dataclass(frozen=True, eq=False)
class _Read:
    """A task's demonstrations, checked; without their trajectories, of which many would be kept."""

    settings: TaskSettings
    demonstrations: tuple[Demonstration, ...]
    checked: CheckedTask


class CheckTask:
    """Checks a task's demonstrations.

    Args:
        profile_of: the profile of a model by its name; raises UnknownModelError, or InvalidInputError for one that is
            not offered here.
        predict: a way to predict that leaves no record: a check's predictions are no robot's.
    """

    def __init__(self, store: Store, profile_of: Callable[[str | None], ModelProfile], predict: Predict) -> None:
        self._store = store
        self._profile_of = profile_of
        self._predict = predict
        self._threads = anyio.CapacityLimiter(1)  # what waits for its turn takes no thread from others
        self._one_at_a_time = threading.Lock()  # a page that is reloaded must not work the same out twice
        self._kept: Cache[TaskState, _Read] = Cache(KEPT)

    def without_model(self, task: str) -> CheckedTask:
        """Predict each demonstration as the center of the others. Synchronous: call it in a thread.

        Raises:
            NotFoundError: if there is no such task.
            NoDemonstrationsError: if it has no episode.
            InvalidInputError: naming an episode that cannot be extracted with the task's settings.
        """
        return self._read(task).checked

    async def __call__(self, task: str, model: str | None = None) -> CheckedTask:
        """Check, and ask the model, if one is named, for what each demonstration does.

        Raises:
            as `without_model`.
            UnknownModelError, InvalidInputError: for a model that there is not, or that is not offered.
            LanguageModelError: if the model does not answer.
        """
        if model is None:
            return await anyio.to_thread.run_sync(self.without_model, task, limiter=self._threads)
        self._profile_of(model)
        read = await anyio.to_thread.run_sync(self._read, task, limiter=self._threads)
        replies = await self._replies(task, model, read)
        findings = (*reply_findings(model, replies), *read.checked.findings)
        return replace(read.checked, model=model, replies=replies, findings=findings)

    def _read(self, name: str) -> _Read:
        with self._one_at_a_time, reading(self._store, name, fresh=self._kept) as now:
            return self._kept.get_or_make(now.task.state, lambda: _checked(now.connection, now.task))

    async def _replies(self, task: str, model: str, read: _Read) -> tuple[ReplyCheck, ...]:
        """Return the model's replies for the first demonstrations that prompts show; each prompt shows the others."""
        shown = {episode.id: episode for plan in read.checked.check.plans if plan.shown for episode in plan.episodes}
        asked = [demonstration for demonstration in read.demonstrations if demonstration.id in shown]
        ids = [demonstration.id for demonstration in asked]
        if len(ids) < 2:
            return ()
        replies = []
        for demonstration in asked[:MAX_ASKED]:
            others = [id_ for id_ in ids if id_ != demonstration.id][: read.settings.num_demonstrations]
            request = _request(task, model, demonstration, others)
            replies.append(await self._reply(request, shown[demonstration.id]))
        return tuple(replies)

    async def _reply(self, request: PredictRequest, episode: EpisodeCheck) -> ReplyCheck:
        try:
            prediction = await self._predict(request)
        except REFUSALS as error:
            return ReplyCheck(episode.id, None, problem=str(error))
        return check_reply(episode, [item.action for item in prediction.reply.actions])


def _checked(connection: Connection, task: TaskRecord) -> _Read:
    settings = TaskSettings.read(connection, task)
    records = episodes.demonstrations(connection, task.name, MAX_CHECKED)
    if not records:
        raise NoDemonstrationsError(task.name)
    given = recordings_of(connection, records, settings)
    symmetries = shown_symmetries(given, settings.yaw_symmetry_deg)
    recordings = folded(given, symmetries)
    check = check_demonstrations(recordings)
    findings = (*check.findings, *symmetry_findings(symmetries))
    num_episodes = episodes.number_of(connection, task.name, left_out=False)
    demonstrations = tuple(recording.demonstration for recording in recordings)
    return _Read(settings, demonstrations, CheckedTask(task.name, num_episodes, check, findings))


def _request(task: str, model: str, demonstration: Demonstration, others: Sequence[str]) -> PredictRequest:
    """Return the request of a robot in the scene of a demonstration."""
    objects = tuple(
        ObjectQuery(
            pose.name,
            tuple(pose.position_m.tolist()),
            None if pose.quaternion_xyzw is None else tuple(pose.quaternion_xyzw.tolist()),
        )
        for pose in demonstration.objects
    )
    start = demonstration.start
    assert start is not None
    end_effector = Pose(start.position_m, start.quaternion_xyzw)
    # an action unlike the demonstrations is measured instead of refused
    return PredictRequest(
        task,
        demonstration.instruction,
        objects,
        end_effector=end_effector,
        options=PredictOptions(model=model, episode_ids=tuple(others), timeout_s=ASKED_TIMEOUT_S, unsupported="allow"),
    )
