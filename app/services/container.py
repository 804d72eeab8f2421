"""The use cases that the web, the command line and tests share, wired by `app.bootstrap`."""

from dataclasses import dataclass

import anyio.to_thread

from app.llm.registry import ModelRegistry
from app.services.configure_task import MAX_AT_ONCE, ConfigureTask
from app.services.draw_overlay import DrawOverlay
from app.services.learn_object_models import LearnObjectModels
from app.services.metrics import Metrics
from app.services.predict_actions import PredictActions
from app.services.run_jobs import RunJobs
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
    run_jobs: RunJobs

    @classmethod
    def wire(
        cls, store: Store, models: ModelRegistry, default_model: str, extract_at_once: int = MAX_AT_ONCE
    ) -> "Services":
        """The use cases over a store and models."""
        metrics = Metrics()
        predict = PredictActions(store, models, default_model, metrics)
        configure = ConfigureTask(store, extract_at_once)
        return cls(
            store=store,
            models=models,
            default_model=default_model,
            upload_episode=UploadEpisode(store),
            configure_task=configure,
            learn_object_models=LearnObjectModels(store, configure),
            draw_overlay=DrawOverlay(store),
            predict_actions=predict,
            metrics=metrics,
            run_jobs=RunJobs(store),
        )

    async def aclose(self) -> None:
        """Stop the models, then close the store."""
        await self.models.aclose()
        await anyio.to_thread.run_sync(self.store.close)
