"""The use cases that the web, the command line and tests share, wired by `app.bootstrap`."""

from dataclasses import dataclass

import anyio.to_thread

from app.llm.registry import ModelRegistry
from app.services.api_keys import KeyRing
from app.services.configure_task import ConfigureTask
from app.services.draw_overlay import DrawOverlay
from app.services.learn_object_models import LearnObjectModels
from app.services.limits import Limits
from app.services.metrics import Metrics
from app.services.pose_servers import PoseServers
from app.services.predict_actions import PredictActions
from app.services.repeated_predictions import RepeatedPredictions
from app.services.upload_episode import UploadEpisode
from app.store.store import Store


@dataclass(frozen=True, eq=False)
class Services:
    """Everything that a request may need."""

    store: Store
    models: ModelRegistry
    default_model: str
    upload_episode: UploadEpisode
    configure_task: ConfigureTask
    learn_object_models: LearnObjectModels
    draw_overlay: DrawOverlay
    predict_actions: PredictActions
    metrics: Metrics
    keys: KeyRing
    repeated_predictions: RepeatedPredictions
    limits: Limits

    @classmethod
    def wire(
        cls,
        store: Store,
        models: ModelRegistry,
        default_model: str,
        limits: Limits | None = None,
        pose_servers: PoseServers | None = None,
    ) -> "Services":
        """The use cases over a store and models; limits and pose servers left out are the defaults."""
        limits, pose_servers = limits or Limits(), pose_servers or PoseServers()
        metrics = Metrics()
        predict = PredictActions(store, models, default_model, metrics, limits, pose_servers)
        configure = ConfigureTask(store, pose_servers)
        return cls(
            store=store,
            models=models,
            default_model=default_model,
            upload_episode=UploadEpisode(store, pose_servers),
            configure_task=configure,
            learn_object_models=LearnObjectModels(store, configure),
            draw_overlay=DrawOverlay(store),
            predict_actions=predict,
            metrics=metrics,
            keys=KeyRing(store),
            repeated_predictions=RepeatedPredictions(store),
            limits=limits,
        )

    async def aclose(self) -> None:
        """Stop the models, then close the store."""
        await self.models.aclose()
        await anyio.to_thread.run_sync(self.store.close)
