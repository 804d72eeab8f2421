"""Models by name: made when first asked for, wrapped as the settings say, kept, closed together."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass

from app.llm.backends import Backend, all_backends
from app.llm.base import LanguageModel, LanguageModelError, ModelProfile, ModelUnavailableError, UnknownModelError
from app.llm.embedded import EmbeddedModel
from app.llm.guard import Guard
from app.llm.recording import RecordingModel, ReplayedModel
from app.llm.resilient import ResilientModel
from app.llm.settings import LlmSettings

MAX_MODELS = 32  # names come from requests, and each model holds connections or a process


@dataclass(frozen=True)
class OfferedModel:
    """A model that requests may name.

    Attributes:
        available: whether nothing is known to be missing; nothing was started to find out.
        reason: why not, and what to install or set; empty if available.
    """

    profile: ModelProfile
    available: bool
    reason: str = ""


@dataclass(frozen=True)
class _Made:
    """A model as its backend made it, and as requests reach it."""

    bare: LanguageModel
    wrapped: LanguageModel


class ModelRegistry:
    """The models of one service.

    Args:
        backends: by name; None for the built-in ones and those of installed packages.
    """

    def __init__(self, settings: LlmSettings, backends: Mapping[str, Backend] | None = None) -> None:
        self._settings = settings
        self._backends = all_backends() if backends is None else backends
        self._models: dict[str, _Made] = {}
        self._guards: dict[str, Guard] = {}

    def get(self, name: str = "") -> LanguageModel:
        """The model named `backend/model`, or the default one. Starts nothing.

        Raises:
            UnknownModelError: no backend or model of that name; lists those offered.
            ModelUnavailableError: something is missing; says what to install or set.
        """
        return self._get(name).wrapped

    def _get(self, name: str) -> _Made:
        name = name or self._settings.default_model
        if name not in self._models:
            if len(self._models) >= MAX_MODELS:
                raise ModelUnavailableError(f"{MAX_MODELS} models are in use already: {', '.join(self._models)}")
            self._models.setdefault(name, self._make(name))  # one model, whichever thread comes first
        return self._models[name]

    def profiles(self) -> list[OfferedModel]:
        """Every offered model, and the default one if it is not among them."""
        offered = {profile.name: self._offer(profile) for profile in self._offered_profiles()}
        if self._settings.default_model not in offered:
            profile = self.get().profile
            offered[profile.name] = OfferedModel(profile, available=True)
        return list(offered.values())

    async def warm_up(self, name: str = "") -> bool:
        """Start an embedded model before the first request needs it; other models have nothing to start.

        Returns whether it is one.

        Raises:
            UnknownModelError, ModelUnavailableError.
        """
        model = self._get(name).bare
        if isinstance(model, EmbeddedModel):
            await model.warm_up()
        return isinstance(model, EmbeddedModel)

    async def aclose(self) -> None:
        """Close every model that was made."""
        models, self._models = list(self._models.values()), {}
        await asyncio.gather(*(model.wrapped.aclose() for model in models))

    def _make(self, name: str) -> _Made:
        backend_name, _, model = name.partition("/")
        if backend_name not in self._backends:
            known = ", ".join(profile.name for profile in self._offered_profiles())
            raise UnknownModelError(f"there is no model {name!r}; there are {known}")
        if self._settings.replay_llm:
            replayed = ReplayedModel(name, self._settings.replay_llm)
            return _Made(replayed, replayed)
        bare = self._backends[backend_name].create(model, self._settings)
        return _Made(bare, self._wrap(bare, name))

    def _wrap(self, model: LanguageModel, name: str) -> LanguageModel:
        """The model within its backend's limits, and recorded if it is to be."""
        backend_name, _, _ = name.partition("/")
        if limits_of := self._backends[backend_name].limits:
            limits = limits_of(self._settings)
            owner = name if limits.each_model else backend_name
            model = ResilientModel(model, self._guards.setdefault(owner, Guard(owner, limits)))
        return RecordingModel(model, self._settings.record_llm) if self._settings.record_llm else model

    def _offered_profiles(self) -> list[ModelProfile]:
        return [profile for backend in self._backends.values() for profile in backend.offered(self._settings)]

    def _offer(self, profile: ModelProfile) -> OfferedModel:
        try:
            self._make(profile.name)
        except LanguageModelError as error:
            return OfferedModel(profile, available=False, reason=str(error))
        return OfferedModel(profile, available=True)
