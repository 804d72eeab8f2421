"""The service's settings, read once from the environment (`ROBOPROMPT_...`) or a `.env` file."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, SecretStr
from pydantic_settings import BaseSettings, SettingsConfigDict

from app.llm.settings import default_cache_folder

MEGABYTE = 1_000_000


class Settings(BaseSettings):
    """Everything that can be set from outside; each has a default that works offline."""

    model_config = SettingsConfigDict(env_prefix="ROBOPROMPT_", env_file=".env", extra="ignore", frozen=True)

    data: Annotated[Path, Field(description="folder of the database and the images")] = Path("data")
    database_url: Annotated[str | None, Field(description="SQLAlchemy URL; empty: SQLite in the data folder")] = None
    max_body_mb: Annotated[float, Field(gt=0, description="larger requests are refused with 413")] = 200
    warm_up: Annotated[bool, Field(description="start the embedded LLM in the background at start-up")] = True

    # The fields of app.llm.settings.LlmSettings, which says what they mean.
    default_model: Annotated[str, Field(description="asked when a request names no model")] = "embedded/gemma-3-270m"
    openai_api_key: Annotated[SecretStr, Field(description="for openai/MODEL")] = SecretStr("")
    openai_base_url: Annotated[str, Field(description="for openai/MODEL")] = "https://api.openai.com/v1"
    compatible_base_url: Annotated[
        str, Field(description="for openai_compatible/MODEL: vLLM, Ollama, llama.cpp ...; ends with /v1")
    ] = ""
    compatible_api_key: Annotated[SecretStr, Field(description="may stay empty where the server asks for none")] = (
        SecretStr("")
    )
    compatible_model: Annotated[str, Field(description="the server's name of its model")] = "default"
    compatible_style: Annotated[Literal["chat", "completion"], Field(description="messages or raw text")] = "chat"
    compatible_llama_cpp: Annotated[bool, Field(description="the server is llama.cpp: it takes grammars")] = False
    cache_folder: Annotated[Path, Field(description="where GGUF weights are assembled")] = default_cache_folder()
    packages_folder: Annotated[Path | None, Field(description="where pip --target put packages of weights")] = None
    embedded_threads: Annotated[int | None, Field(ge=1, description="CPU threads; empty: one per core")] = None
    embedded_slots: Annotated[int, Field(ge=1, description="predictions that share an embedded model at once")] = 4
    embedded_context_tokens: Annotated[int, Field(ge=512, description="longest prompt plus reply")] = 8192
    scripted_replies: Annotated[tuple[str, ...], Field(description="what the backend `scripted` replies, in turn")] = ()
