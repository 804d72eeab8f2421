"""The backends by name: how each makes a model, and which models it offers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from pydantic import SecretStr

from app.llm.anthropic import AnthropicModel
from app.llm.base import LanguageModel, ModelProfile, ModelUnavailableError, UnknownModelError
from app.llm.computed import NEAREST, REGRESSION, SCRIPTED, ScriptedModel, nearest, regression
from app.llm.llama.embedded import embedded_model, embedded_profile
from app.llm.llama.weights import GEMMA
from app.llm.llm_settings import LlmSettings, variable
from app.llm.openai_compatible import SERVERS, OpenAiCompatibleModel, ServerQuirks, quirks_of
from app.llm.resilient import ProviderLimits
from app.llm.sse import Server

QUEUED = 32  # robots that wait for a place; further ones are told at once that the model is busy

# A model from the part of its name after `backend/` (empty if there is none) and the settings. Quick: it starts nothing
# and connects to nothing. Raises UnknownModelError, or ModelUnavailableError for what is missing.
ModelFactory = Callable[[str, LlmSettings], LanguageModel]


@dataclass(frozen=True)
class Backend:
    """A way to LLMs.

    Attributes:
        create: makes any of its models, also such as are not offered.
        offered: the models to show to people, whether or not they can be used at present.
        limits: how many requests it bears and how often it is asked again; None: any number, and once.
    """

    create: ModelFactory
    offered: Callable[[LlmSettings], Sequence[ModelProfile]]
    limits: Callable[[LlmSettings], ProviderLimits] | None = None


def _network_limits(settings: LlmSettings) -> ProviderLimits:
    """Of a provider's account, whichever of its models is asked. Providers' own limits are far above."""
    return ProviderLimits(concurrent=8, queued=QUEUED, retries=2, backoff_s=0.5)


def _embedded_limits(settings: LlmSettings) -> ProviderLimits:
    """Of a model's slots. A second try finds llama.cpp started again if it died."""
    return ProviderLimits(settings.embedded_slots, QUEUED, retries=1, each_model=True)


def _provider(
    name: str, models: Mapping[str, str], make: Callable[[ModelProfile, Server, str], LanguageModel]
) -> Backend:
    """Return the backend of a provider whose models need a key; `models` are those offered, with descriptions."""

    def profile(model: str) -> ModelProfile:
        description = models.get(model, "")
        return ModelProfile(
            f"{name}/{model}", "chat", grammar=False, representation="absolute", description=description
        )

    def create(model: str, settings: LlmSettings) -> LanguageModel:
        _require_model_name(name, model)
        server = _server(name, settings)
        if not server.key:
            raise ModelUnavailableError(f"{name}/{model} needs a key: set {server.key_variable}")
        return make(profile(model), server, model)

    return Backend(create, lambda settings: [profile(model) for model in models], _network_limits)


def _server(name: str, settings: LlmSettings) -> Server:
    """The server of the settings `NAME_base_url` and `NAME_api_key`."""
    url, key = f"{name}_base_url", f"{name}_api_key"
    secret: SecretStr = getattr(settings, key)
    return Server(getattr(settings, url), secret.get_secret_value(), variable(key), variable(url))


def _openai_compatible(model: str, settings: LlmSettings) -> LanguageModel:
    _require_model_name("openai_compatible", model)
    server = _server("compatible", settings)
    if not server.base_url:
        remedy = f"set {server.url_variable}, e.g. http://127.0.0.1:11434/v1"
        raise ModelUnavailableError(f"openai_compatible/{model} needs the address of a server: {remedy}")
    return OpenAiCompatibleModel(_compatible_profile(model, settings), server, model, _compatible_quirks(settings))


def _compatible_quirks(settings: LlmSettings) -> ServerQuirks:
    server = settings.compatible_server
    return quirks_of(settings.compatible_base_url) if server == "other" else SERVERS[server]


def _compatible_model(settings: LlmSettings) -> str:
    """Return the name to offer: the default model's; servers of one model take any."""
    backend, _, model = settings.default_model.partition("/")
    return model if backend == "openai_compatible" and model else "default"


def _compatible_profile(model: str, settings: LlmSettings) -> ModelProfile:
    """A chat model is asked as in the paper; one that continues text and takes a grammar, like the embedded ones."""
    completes = settings.compatible_style == "completion"
    grammar = bool(_compatible_quirks(settings).grammar_path)
    return ModelProfile(
        name=f"openai_compatible/{model}",
        style=settings.compatible_style,
        grammar=grammar,
        representation="object_frame" if completes and grammar else "absolute",
        system_prompt="none" if completes else "a",
        description="A server that speaks OpenAI's API",
    )


def _scripted(settings: LlmSettings) -> LanguageModel:
    if not settings.scripted_replies:
        raise ModelUnavailableError(f"scripted has nothing to say: set {variable('scripted_replies')}")
    return ScriptedModel(settings.scripted_replies)


def _require_model_name(backend: str, model: str) -> None:
    if not model:
        raise UnknownModelError(f"{backend} needs the name of a model: {backend}/MODEL")


def _single(
    name: str, make: Callable[[LlmSettings], LanguageModel], offered: Callable[[LlmSettings], Sequence[ModelProfile]]
) -> Backend:
    """Return a backend that has one model."""

    def create(model: str, settings: LlmSettings) -> LanguageModel:
        if model:
            raise UnknownModelError(f"{name} has no models to choose from: ask for {name!r}, not '{name}/{model}'")
        return make(settings)

    return Backend(create, offered)


BUILT_IN: Mapping[str, Backend] = {
    "embedded": Backend(embedded_model, lambda settings: [embedded_profile(GEMMA)], _embedded_limits),
    "anthropic": _provider(
        "anthropic",
        {
            "claude-opus-5-5": "Anthropic's large model; thinks a little before every reply",
            "claude-sonnet-5-5": "Anthropic's middle model; replies at once",
            "claude-haiku-5-5": "Anthropic's small model, the cheapest; replies at once",
        },
        AnthropicModel,
    ),
    "openai": _provider(
        "openai",
        {
            "gpt-4-turbo": "The paper's main model (51.8 % of 16 RLBench tasks)",
            "gpt-4o": "The best of the paper's comparison (56.3 % of 16 RLBench tasks)",
            "gpt-4o-mini": "44.8 % of 16 RLBench tasks in the paper",
        },
        OpenAiCompatibleModel,
    ),
    "openai_compatible": Backend(
        _openai_compatible,
        lambda settings: [_compatible_profile(_compatible_model(settings), settings)],
        _network_limits,
    ),
    "nearest": _single("nearest", lambda settings: nearest(), lambda settings: [NEAREST]),
    "regression": _single("regression", lambda settings: regression(), lambda settings: [REGRESSION]),
    "scripted": _single("scripted", _scripted, lambda settings: [SCRIPTED] if settings.scripted_replies else []),
}
