"""The service's settings, read once from the environment: `ROBOPROMPT_...`."""

import os
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Literal

from dotenv import dotenv_values
from pydantic import Field, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from app.llm.llm_settings import ENV_PREFIX, LlmSettings


class Settings(LlmSettings, BaseSettings):
    """Everything that can be set from outside, LLMs included; each has a default that works offline."""

    model_config = SettingsConfigDict(env_prefix=ENV_PREFIX, extra="ignore", frozen=True)

    data: Path = Path("data")
    """folder of the database and the images"""
    database_url: str | None = None
    """SQLAlchemy URL; empty: SQLite in the data folder"""
    blobs_url: str | None = None
    """object store of the images, e.g. s3://bucket/prefix; empty: the data folder"""
    auth: Literal["auto", "on", "off", "local"] = "auto"
    """whether API keys are required; local: no, and only requests to this machine's own names are answered; auto: local
    where `serve` is bound to this machine, else on"""
    trusted_proxies: tuple[str, ...] = ()
    """JSON list of addresses or networks of reverse proxies whose X-Forwarded-For and -Proto are believed by
    `roboprompt serve`; empty: none"""
    rate_limit_per_s: Annotated[float | None, Field(ge=0)] = None
    """requests per second of one key or address; 0: no limit; empty: 20 where keys are required"""
    max_body_mb: Annotated[float, Field(gt=0)] = 200
    """largest request with images or a trajectory, in megabytes; larger ones get 413"""
    pose_servers: tuple[str, ...] = ()
    """JSON list of URL prefixes that `remote` may send images to; empty: this machine only"""
    allowed_models: tuple[str, ...] = ()
    """JSON list of models that requests may use besides the default, e.g. `["openai/gpt-4o*"]`; empty: any"""
    warm_up: bool = True
    """start the embedded LLM at start-up and let it read prefixes before they are asked for"""

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
