"""The operator's settings of LLMs; `app.settings.Settings`, which reads the environment, has these fields, too."""

from pathlib import Path
from typing import Annotated, Literal

import platformdirs
from pydantic import BaseModel, ConfigDict, Field, SecretStr

ENV_PREFIX = "ROBOPROMPT_"
CACHE = platformdirs.user_cache_path("roboprompt")
Style = Literal["chat", "completion"]
CompatibleServer = Literal["other", "llama_cpp", "vllm", "sglang", "ollama", "lm_studio"]


def variable(setting: str) -> str:
    """The environment variable that fills a setting, for messages that tell what to set."""
    return f"{ENV_PREFIX}{setting.upper()}"


class LlmSettings(BaseModel):
    """Keys, addresses and sizes; each field is filled by the environment variable `variable(field)`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    default_model: Annotated[str, Field(description="asked when a request names no model")] = "embedded/gemma-3-270m"
    openai_api_key: Annotated[SecretStr, Field(description="for openai/MODEL")] = SecretStr("")
    openai_base_url: Annotated[str, Field(description="for openai/MODEL")] = "https://api.openai.com/v1"
    anthropic_api_key: Annotated[SecretStr, Field(description="for anthropic/MODEL")] = SecretStr("")
    anthropic_base_url: Annotated[str, Field(description="for anthropic/MODEL; ends with /v1")] = (
        "https://api.anthropic.com/v1"
    )
    compatible_base_url: Annotated[
        str, Field(description="for openai_compatible/MODEL: vLLM, Ollama, llama.cpp ...; ends with /v1")
    ] = ""
    compatible_api_key: Annotated[SecretStr, Field(description="may stay empty where the server asks for none")] = (
        SecretStr("")
    )
    compatible_style: Annotated[Style, Field(description="messages or raw text")] = "chat"
    compatible_server: Annotated[
        CompatibleServer,
        Field(
            description="what the server is, if it can hold replies to a form: llama_cpp, vllm, "
            "sglang, ollama, lm_studio"
        ),
    ] = "other"
    cache_folder: Annotated[Path, Field(description="where GGUF weights are assembled")] = CACHE
    embedded_threads: Annotated[int | None, Field(ge=1, description="CPU threads; empty: one per core")] = None
    embedded_slots: Annotated[int, Field(ge=1, description="predictions that share an embedded model at once")] = 4
    embedded_context_tokens: Annotated[int, Field(ge=512, description="longest prompt plus reply")] = 8192
    scripted_replies: Annotated[tuple[str, ...], Field(description="what the backend `scripted` replies, in turn")] = ()
