"""What the service needs to know of the models that a request may name."""

from app.llm.base import ModelProfile
from app.llm.registry import ModelRegistry
from app.services.limits import Limits


class AllowedProfiles:
    """The profile of a model by its name, of the default for None."""

    def __init__(self, models: ModelRegistry, default_model: str, limits: Limits) -> None:
        self._models = models
        self._default_model = default_model
        self._limits = limits

    def __call__(self, name: str | None) -> ModelProfile:
        """The profile.

        Raises:
            UnknownModelError: for an unknown model, or one that requests may not name.
        """
        if name is not None and name != self._default_model:
            self._limits.check_model(name)
        return self._models.get(name or self._default_model).profile
