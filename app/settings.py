"""The service's settings, read once from the environment: `ROBOPROMPT_...`."""

import os
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Literal

from dotenv import dotenv_values
from pydantic import Field, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from app.llm.llm_settings import ENV_PREFIX, LlmSettings

MEGA = 1_000_000  # bytes of a megabyte, pixels of a megapixel


class Settings(LlmSettings, BaseSettings):
    """Everything that can be set from outside, LLMs included; each has a default that works offline."""

    model_config = SettingsConfigDict(env_prefix=ENV_PREFIX, extra="ignore", frozen=True)

    data: Path = Path("data")
    """folder of the database and the images"""
    database_url: str | None = None
    """SQLAlchemy URL; empty: SQLite in the data folder"""
    blobs_url: str | None = None
    """object store of the images, e.g. s3://bucket/prefix; empty: the data folder"""
    database_connections: Annotated[int, Field(ge=2)] = 16
    """largest number of connections of each worker to PostgreSQL"""
    max_body_mb: Annotated[float, Field(gt=0)] = 200
    """largest request with images as multipart or MessagePack; larger ones get 413"""
    max_inline_mb: Annotated[float, Field(gt=0)] = 32
    """largest JSON request with images in base64 or with a trajectory as lists"""
    max_document_mb: Annotated[float, Field(gt=0)] = 1
    """largest other request, and largest part that is neither image nor trajectory"""
    max_held_mb: Annotated[float, Field(gt=0)] = 1000
    """size of all request bodies that a worker handles at a time; more get 503"""
    host: str | None = None
    """address that the service is bound to, as `serve --host` says; empty: unknown"""
    auth: Literal["auto", "on", "off"] = "auto"
    """whether API keys are required; auto: as soon as other machines can connect"""
    trusted_proxies: tuple[str, ...] = ()
    """JSON list of addresses or networks of reverse proxies whose X-Forwarded-For and -Proto are believed by
    `roboprompt serve`; empty: none"""
    rate_limit_per_s: Annotated[float | None, Field(ge=0)] = None
    """requests per second of one key or address; 0: no limit; empty: 20 where keys are required"""
    rate_limit_burst: Annotated[int, Field(ge=1)] = 40
    """requests that one key or address may send at once"""
    max_connections: Annotated[int, Field(ge=10)] = 500
    """largest number of open connections to a worker of `roboprompt serve`; more get 503"""
    max_query_chars: Annotated[int, Field(ge=100)] = 2000
    """length of an address's query; longer ones get 414"""
    pose_servers: tuple[str, ...] = ()
    """JSON list of URL prefixes that `remote` may send images to; empty: this machine only"""
    max_image_megapixels: Annotated[float, Field(gt=0)] = 16
    """size of one image, checked before it is decoded"""
    max_request_megapixels: Annotated[float, Field(gt=0)] = 64
    """size of all images of a request together"""
    max_unpacked_mb: Annotated[float, Field(gt=0)] = 100
    """unpacked size of a trajectory's .npz, checked before it is unpacked"""
    max_frames: Annotated[int, Field(ge=1)] = 100_000
    """largest number of frames of a trajectory"""
    max_prompt_chars: Annotated[int, Field(ge=100)] = 400_000
    """length of system prompt and demonstrations together"""
    allowed_models: tuple[str, ...] = ()
    """JSON list of models that requests may use besides the default, e.g. `["openai/gpt-4o*"]`"""
    keep_predictions_days: Annotated[float | None, Field(gt=0)] = None
    """age at which predictions are deleted with their images; empty: never"""
    keep_predictions_gb: Annotated[float | None, Field(gt=0)] = None
    """size of all predictions with their images; beyond it the oldest are deleted; empty: no limit"""
    warm_up: bool = True
    """start the embedded LLM at start-up and let it read prefixes before they are asked for"""

    log_format: Literal["text", "json"] = "text"
    """form of the log; json: with ids of requests, tasks and predictions"""
    otel_endpoint: str | None = None
    """OpenTelemetry collector that gets traces, e.g. http://127.0.0.1:4318"""

    @field_validator("trusted_proxies")
    @classmethod
    def _are_networks(cls, proxies: tuple[str, ...]) -> tuple[str, ...]:
        for proxy in proxies:
            ip_network(proxy)
        return proxies


def load_env_file(path: Path) -> None:
    """Put a file's settings into the environment, for this process and those that it starts; what is there stays.

    Only a file that the user names is read: one in the working directory may come from someone else, and could switch
    keys off or send a provider's key elsewhere.
    """
    for name, value in dotenv_values(path).items():
        if name.upper().startswith(ENV_PREFIX) and value is not None:
            os.environ.setdefault(name.upper(), value)
