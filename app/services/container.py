"""The use cases that the web, the command line and tests share, wired by `app.bootstrap`."""

from dataclasses import dataclass

import anyio.to_thread

from app.llm.registry import ModelRegistry
from app.services.configure_task import ConfigureTask
from app.services.draw_overlay import DrawOverlay
from app.services.learn_object_models import LearnObjectModels
from app.services.metrics import Metrics
from app.services.predict_actions import PredictActions
from app.services.prefix_warmer import PrefixWarmer
from app.services.question import QuestionWriter
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
    prefix_warmer: PrefixWarmer
    metrics: Metrics

    @classmethod
    def wire(cls, store: Store, models: ModelRegistry, default_model: str, num_warm_tasks: int = 0) -> "Services":
        """The use cases over a store and models.

        Args:
            num_warm_tasks: how many tasks' prefixes the prefix warmer, where it runs, sends at start-up.
        """
        metrics = Metrics()
        write_question = QuestionWriter(store, lambda name: models.get(name or default_model).profile)
        warmer = PrefixWarmer(store, models, write_question, num_warm_tasks)
        predict = PredictActions(store, models, write_question, warmer, metrics)
        configure = ConfigureTask(store)
        return cls(
            store=store,
            models=models,
            default_model=default_model,
            upload_episode=UploadEpisode(store),
            configure_task=configure,
            learn_object_models=LearnObjectModels(store, configure),
            draw_overlay=DrawOverlay(store),
            predict_actions=predict,
            prefix_warmer=warmer,
            metrics=metrics,
        )

    async def aclose(self) -> None:
        """Stop the models, then close the store."""
        await self.models.aclose()
        await anyio.to_thread.run_sync(self.store.close)
