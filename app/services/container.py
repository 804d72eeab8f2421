"""The use cases that the web, the command line and tests share, wired by `app.bootstrap`."""

from dataclasses import dataclass, field

import anyio
import anyio.to_thread

from app.llm.base import ModelProfile
from app.llm.registry import ModelRegistry
from app.services.api_keys import KeyRing, Sessions
from app.services.english import is_english
from app.services.limits import Limits
from app.services.measures import Metrics
from app.services.predict.ask import PredictActions
from app.services.predict.instruction import ReadSteps
from app.services.predict.known import KnownReader
from app.services.predict.motion_check import CurrentLimits, RepeatedPredictions
from app.services.predict.record import PredictionRecorder
from app.services.predict.warm import PrefixWarmer
from app.services.teach.check import CheckTask
from app.services.teach.configure import MAX_AT_ONCE, ConfigureTask, RunJobs
from app.services.teach.labels import LabelObjects
from app.services.teach.upload import UploadEpisode
from app.services.vision import PoseServers
from app.store.store import Store

TEACHING_AT_ONCE = 4


@dataclass(frozen=True, eq=False)
class Services:
    """Everything that a request may need.

    Attributes:
        teaching: the turn to upload, learn and configure, which compute for long: of forty such threads at once the
            event loop would get every fortieth slice of time, and robots would wait.
    """

    store: Store
    models: ModelRegistry
    default_model: str
    known: KnownReader
    upload_episode: UploadEpisode
    configure_task: ConfigureTask
    pose_servers: PoseServers
    label_objects: LabelObjects
    predict_actions: PredictActions
    read_steps: ReadSteps
    check_task: CheckTask
    prefix_warmer: PrefixWarmer
    metrics: Metrics
    keys: KeyRing
    sessions: Sessions
    repeated_predictions: RepeatedPredictions
    limits: Limits
    run_jobs: RunJobs
    teaching: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(TEACHING_AT_ONCE))

    @classmethod
    def wire(
        cls,
        store: Store,
        models: ModelRegistry,
        default_model: str,
        limits: Limits | None = None,
        pose_servers: PoseServers | None = None,
        *,
        extract_at_once: int = MAX_AT_ONCE,
        num_warm_tasks: int = 0,
    ) -> "Services":
        """The use cases over a store and models; limits and pose servers left out are the defaults.

        Args:
            extract_at_once: how many episodes a change of settings extracts again within the request.
            num_warm_tasks: how many tasks' prefixes the prefix warmer, where it runs, sends at start-up.
        """
        limits, pose_servers = limits or Limits(), pose_servers or PoseServers()

        def profile_of(name: str | None) -> ModelProfile:
            if name is not None and name != default_model:
                limits.check_model(name)
            return models.profile(name or default_model)

        metrics = Metrics()
        known = KnownReader(store, profile_of, pose_servers)
        warmer = PrefixWarmer(store, models, known, num_warm_tasks)
        of_motion = CurrentLimits(store)
        parts = (models, known, limits, of_motion, warmer, store.under_way)
        is_english("")  # reads its list now, so that no request waits for it
        keys = KeyRing(store)
        return cls(
            store=store,
            models=models,
            default_model=default_model,
            known=known,
            upload_episode=UploadEpisode(store, pose_servers),
            configure_task=ConfigureTask(store, pose_servers, extract_at_once),
            pose_servers=pose_servers,
            label_objects=LabelObjects(store),
            predict_actions=PredictActions(*parts, PredictionRecorder(store, metrics)),
            read_steps=ReadSteps(store),
            check_task=CheckTask(store, profile_of, PredictActions(*parts, None)),
            prefix_warmer=warmer,
            metrics=metrics,
            keys=keys,
            sessions=Sessions(store, keys),
            repeated_predictions=RepeatedPredictions(store, of_motion),
            limits=limits,
            run_jobs=RunJobs(store, on_done=warmer.changed),
        )

    async def aclose(self) -> None:
        await self.models.aclose()
        await self.keys.aclose()
        await anyio.to_thread.run_sync(self.store.close)
