"""Models by name: made at their first use, wrapped by `resilient`, kept while there is room, closed together."""

import asyncio
import threading
from collections import Counter, OrderedDict
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass

from app.llm.backends import Backend, all_backends
from app.llm.base import (
    LanguageModel,
    LanguageModelError,
    ModelBusyError,
    ModelProfile,
    StartedModel,
    UnknownModelError,
)
from app.llm.llm_settings import LlmSettings
from app.llm.resilient import NO_LIMITS, Places, ResilientModel

# Names come from requests, and each model holds connections or a process: so many are kept beside those that backends
# offer and the default one, which always have a place.
MAX_MODELS = 32


@dataclass(frozen=True)
class OfferedModel:
    """A model that requests may name."""

    profile: ModelProfile
    available: bool  # whether nothing is known to be missing; nothing was started to find out
    reason: str = ""  # why not, and what to install or set; empty if available


class ModelRegistry:
    """The models of one service.

    Args:
        backends: by name; None for the built-in ones and those of installed packages.
    """

    def __init__(self, settings: LlmSettings, backends: Mapping[str, Backend] | None = None) -> None:
        self._settings = settings
        self._backends = all_backends() if backends is None else backends
        self._models: OrderedDict[str, ResilientModel] = OrderedDict()  # the one unused for longest first
        self._places: dict[str, Places] = {}
        self._users: Counter[str] = Counter()
        self._evicted: list[ResilientModel] = []  # not closed yet
        self._lock = threading.Lock()
        offered = (profile.name for profile in self._offered_profiles())
        self._reserved = frozenset((settings.default_model, *offered))

    def get(self, name: str = "") -> LanguageModel:
        """The model named `backend/model`, or the default one. Starts nothing.

        It is kept until others need its place; a caller that waits for a reply calls `using`.

        Raises:
            UnknownModelError: no backend or model of that name; lists those offered.
            ModelUnavailableError: something is missing; says what to install or set.
            ModelBusyError: as many others as are kept are all in use.
        """
        return self._get(name or self._settings.default_model)

    def profile(self, name: str = "") -> ModelProfile:
        """Return the model's profile. Of models that are not in use, only the default one is kept.

        Raises:
            UnknownModelError, ModelUnavailableError.
        """
        name = name or self._settings.default_model
        if name in self._models or name == self._settings.default_model:
            return self._get(name).profile
        return self._make(name).profile

    @asynccontextmanager
    async def using(self, name: str) -> AsyncIterator[LanguageModel]:
        """The model, which stays open inside the block; raises as `get`."""
        model = self._get(name, using=True)
        try:
            await self._close_evicted()
            yield model
        finally:
            with self._lock:
                self._users[name] -= 1
                self._users += Counter()  # forget those that are not in use

    def _get(self, name: str, *, using: bool = False) -> ResilientModel:
        new = None if name in self._models else self._make(name)
        with self._lock:
            if name not in self._models:
                self._make_room(name)
                self._models[name] = new or self._make(name)  # one model, whichever thread comes first
            self._models.move_to_end(name)
            self._users[name] += using
            return self._models[name]

    def _make_room(self, name: str) -> None:
        kept = [] if name in self._reserved else [other for other in self._models if other not in self._reserved]
        if len(kept) < MAX_MODELS:
            return
        if (idle := next((other for other in kept if not self._users[other]), None)) is None:
            raise ModelBusyError(f"{MAX_MODELS} other models are in use at present", retryable=True, retry_after_s=1.0)
        self._evicted.append(self._models.pop(idle))
        self._places.pop(idle, None)

    async def _close_evicted(self) -> None:
        while self._evicted:
            await self._evicted.pop().aclose()

    def profiles(self) -> list[OfferedModel]:
        """Every offered model, and the default one if it is not among them."""
        offered = {profile.name: self._offer(profile) for profile in self._offered_profiles()}
        if self._settings.default_model not in offered:
            profile = self.profile()
            offered[profile.name] = OfferedModel(profile, available=True)
        return list(offered.values())

    async def warm_up(self, name: str = "") -> bool:
        """Start an embedded model before the first request needs it; returns whether it is one. Raises as `profile`."""
        model = self._get(name or self._settings.default_model).model
        if isinstance(model, StartedModel):
            await model.warm_up()
        return isinstance(model, StartedModel)

    async def aclose(self) -> None:
        """Close every model that was made."""
        models, self._models = [*self._models.values(), *self._evicted], OrderedDict()
        self._evicted.clear()
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
