"""The only place that picks the parts and wires them."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from importlib.metadata import version

from fastapi import FastAPI

from app.api.app import create_app
from app.llm.registry import ModelRegistry
from app.llm.settings import LlmSettings
from app.services.container import Services
from app.settings import MEGABYTE, Settings
from app.store.store import Store


def llm_settings(settings: Settings) -> LlmSettings:
    """What the LLM backends need of the settings."""
    return LlmSettings(
        default_model=settings.default_model,
        openai_api_key=settings.openai_api_key.get_secret_value(),
        openai_base_url=settings.openai_base_url,
        anthropic_api_key=settings.anthropic_api_key.get_secret_value(),
        anthropic_base_url=settings.anthropic_base_url,
        compatible_base_url=settings.compatible_base_url,
        compatible_api_key=settings.compatible_api_key.get_secret_value(),
        compatible_model=settings.compatible_model,
        compatible_style=settings.compatible_style,
        compatible_server=settings.compatible_server,
        cache_folder=settings.cache_folder,
        packages_folder=settings.packages_folder,
        embedded_threads=settings.embedded_threads,
        embedded_slots=settings.embedded_slots,
        embedded_context_tokens=settings.embedded_context_tokens,
        scripted_replies=settings.scripted_replies,
        llm_concurrent_requests=settings.llm_concurrent_requests,
        llm_queued_requests=settings.llm_queued_requests,
        llm_retries=settings.llm_retries,
        llm_backoff_s=settings.llm_backoff_s,
        llm_failures=settings.llm_failures,
        llm_pause_s=settings.llm_pause_s,
        record_llm=settings.record_llm,
        replay_llm=settings.replay_llm,
    )


@contextlib.asynccontextmanager
async def open_services(settings: Settings) -> AsyncIterator[Services]:
    """Open the store, sweep what earlier crashes left, start the default model in the background; close all at the end.

    Raises:
        StoreError: if the data folder cannot be used.
    """
    store = await asyncio.to_thread(Store.open, settings.data, settings.database_url)
    models = ModelRegistry(llm_settings(settings))
    services = Services.wire(store, models, settings.default_model, settings.embedded_slots)
    background: list[asyncio.Task[object]] = [asyncio.create_task(asyncio.to_thread(store.sweep))]
    if settings.warm_up:
        background.append(asyncio.create_task(services.prefix_warmer.run()))
    try:
        yield services
    finally:
        for task in background:
            task.cancel()
        await asyncio.gather(*background, return_exceptions=True)
        await services.aclose()


def build_app(settings: Settings) -> FastAPI:
    """The ASGI application for these settings."""
    return create_app(lambda: open_services(settings), version("roboprompt"), int(settings.max_body_mb * MEGABYTE))
