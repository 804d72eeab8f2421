"""The use cases that the web, the command line and tests share, wired by `app.bootstrap`."""

import os

import anyio
import anyio.to_thread

from app.llm.base import ModelProfile
from app.llm.registry import ModelRegistry
from app.services.api_keys import KeyRing
from app.services.measures import Metrics
from app.services.offered_models import OfferedModels
from app.services.poses import PoseServers
from app.services.predict.ask import PredictActions
from app.services.predict.known import KnownReader
from app.services.predict.record import PredictionRecorder
from app.services.predict.steps import ReadSteps
from app.services.predict.warm import PrefixWarmer
from app.services.teach.check import CheckTask
from app.services.teach.configure import ConfigureTask
from app.services.teach.labels import LabelObjects
from app.services.teach.upload import UploadEpisode
from app.store.store import Store

TEACHING_AT_ONCE = 4


class Services:
    """Everything that a request may need: the use cases over a store and models.

    Args:
        offered, pose_servers: left out: the defaults.
        num_warm_tasks: how many tasks' prefixes the prefix warmer, where it runs, sends at start-up.

    Attributes:
        decoding: the turn to decode images, which takes memory and a core each.
        teaching: the turn to upload, learn and configure, which compute for long: of forty such threads at once the
            event loop would get every fortieth slice of time, and robots would wait.
    """

    def __init__(
        self,
        store: Store,
        models: ModelRegistry,
        default_model: str,
        offered: OfferedModels | None = None,
        pose_servers: PoseServers | None = None,
        *,
        num_warm_tasks: int = 0,
    ) -> None:
        self.store, self.models, self.default_model = store, models, default_model
        self.pose_servers = pose_servers or PoseServers()
        self._offered = offered or OfferedModels()
        self.metrics = Metrics()
        self.known = KnownReader(store, self._profile_of, self.pose_servers)
        self.prefix_warmer = PrefixWarmer(store, models, self.known, num_warm_tasks)
        parts = (store, models, self.known, self.prefix_warmer)
        self.upload_episode = UploadEpisode(store, self.pose_servers)
        self.configure_task = ConfigureTask(store, self.pose_servers)
        self.label_objects = LabelObjects(store)
        self.predict_actions = PredictActions(*parts, PredictionRecorder(store, self.metrics))
        self.read_steps = ReadSteps(store)
        self.check_task = CheckTask(self.known)
        self.keys = KeyRing(store)
        self.decoding = anyio.CapacityLimiter(max(2, os.cpu_count() or 1))
        self.teaching = anyio.CapacityLimiter(TEACHING_AT_ONCE)

    def _profile_of(self, name: str | None) -> ModelProfile:
        if name is not None and name != self.default_model:
            self._offered.check(name)
        return self.models.profile(name or self.default_model)

    async def aclose(self) -> None:
        await self.models.aclose()
        await anyio.to_thread.run_sync(self.store.close)
