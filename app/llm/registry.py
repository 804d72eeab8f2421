"""Models by name: made at their first use, wrapped by `resilient`, closed together."""

import asyncio
import threading
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass

from app.llm.backends import BUILT_IN, Backend
from app.llm.base import (
    LanguageModel,
    LanguageModelError,
    ModelProfile,
    StartedModel,
    UnknownModelError,
)
from app.llm.llm_settings import LlmSettings
from app.llm.resilient import NO_LIMITS, Places, ResilientModel


@dataclass(frozen=True)
class OfferedModel:
    """A model that requests may name."""

    profile: ModelProfile
    available: bool  # whether nothing is known to be missing; nothing was started to find out
    reason: str = ""  # why not, and what to install or set; empty if available


class ModelRegistry:
    """The models of one service; backends are by name."""

    def __init__(self, settings: LlmSettings, backends: Mapping[str, Backend] = BUILT_IN) -> None:
        self._settings, self._backends = settings, backends
        self._models: dict[str, ResilientModel] = {}
        self._places: dict[str, Places] = {}
        self._lock = threading.Lock()
        offered = (profile.name for profile in self._offered_profiles())
        self._reserved = frozenset((settings.default_model, *offered))

    def get(self, name: str = "") -> ResilientModel:
        """The model named `backend/model`, or the default one. Starts nothing.

        Names come from requests: only a model that is offered, or that starts, is kept.

        Raises:
            UnknownModelError: no backend or model of that name; lists those offered.
            ModelUnavailableError: something is missing; says what to install or set.
        """
        name = name or self._settings.default_model
        with self._lock:
            if name in self._models:
                return self._models[name]
            made = self._make(name)
            if name in self._reserved or isinstance(made.model, StartedModel):
                self._models[name] = made
            return made

    def profile(self, name: str = "") -> ModelProfile:
        """Return the model's profile; raises as `get`."""
        return self.get(name).profile

    @asynccontextmanager
    async def using(self, name: str) -> AsyncIterator[LanguageModel]:
        """The model, which stays open inside the block; raises as `get`."""
        model = self.get(name)
        try:
            yield model
        finally:
            if name not in self._models:
                await model.aclose()

    def profiles(self) -> list[OfferedModel]:
        """Every offered model, and the default one if it is not among them."""
        offered = {profile.name: self._offer(profile) for profile in self._offered_profiles()}
        if self._settings.default_model not in offered:
            profile = self.profile()
            offered[profile.name] = OfferedModel(profile, available=True)
        return list(offered.values())

    async def warm_up(self) -> bool:
        """Start the default model before the first request needs it; returns whether it starts. Raises as `get`."""
        model = self.get().model
        if isinstance(model, StartedModel):
            await model.warm_up()
        return isinstance(model, StartedModel)

    async def aclose(self) -> None:
        """Close every model that is kept."""
        models, self._models = self._models.values(), {}
        await asyncio.gather(*(model.aclose() for model in models))

    def _make(self, name: str) -> ResilientModel:
        backend_name, _, model = name.partition("/")
        if backend_name not in self._backends:
            known = ", ".join(profile.name for profile in self._offered_profiles())
            raise UnknownModelError(f"there is no model {name!r}; there are {known}")
        backend = self._backends[backend_name]
        bare = backend.create(model, self._settings)
        limits = backend.limits(self._settings) if backend.limits else NO_LIMITS
        owner = name if limits.each_model else backend_name
        return ResilientModel(bare, self._places.setdefault(owner, Places(owner, limits)))

    def _offered_profiles(self) -> list[ModelProfile]:
        return [profile for backend in self._backends.values() for profile in backend.offered(self._settings)]

    def _offer(self, profile: ModelProfile) -> OfferedModel:
        try:
            self._make(profile.name)
        except LanguageModelError as error:
            return OfferedModel(profile, available=False, reason=str(error))
        return OfferedModel(profile, available=True)
