"""The only place that picks the parts and wires them."""

import asyncio
import atexit
import contextlib
import logging
from collections.abc import AsyncIterator
from importlib.metadata import version

from fastapi import FastAPI

from app.api.app import create_app
from app.llm.base import LanguageModelError
from app.llm.registry import ModelRegistry
from app.llm.settings import LlmSettings
from app.pipeline.errors import RoboPromptError
from app.services.container import Services
from app.settings import MEGABYTE, Settings
from app.store.store import Store

JOB_POLL_S = 1.0
logger = logging.getLogger(__name__)


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
        embedded_shared_folder=settings.embedded_shared_folder,
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


def open_store(settings: Settings) -> Store:
    """The store of these settings, at the newest schema. Blocking.

    Raises:
        StoreError: if the data folder or the database cannot be used.
    """
    return Store.open(
        settings.data,
        settings.database_url,
        settings.blobs_url,
        server_connections=settings.database_connections,
    )


@contextlib.asynccontextmanager
async def open_services(settings: Settings) -> AsyncIterator[Services]:
    """Open the store, sweep what earlier crashes left, start the default model in the background; close all at the end.

    Raises:
        StoreError: if the data folder cannot be used.
    """
    store = await asyncio.to_thread(open_store, settings)
    models = ModelRegistry(llm_settings(settings))
    services = Services.wire(store, models, settings.default_model, settings.extract_at_once)
    jobs = asyncio.create_task(_run_jobs(services))
    background: list[asyncio.Task[object]] = [asyncio.create_task(asyncio.to_thread(store.sweep_once))]
    if settings.warm_up:
        background.append(asyncio.create_task(_warm_up(services)))
    try:
        yield services
    finally:
        for task in background:
            task.cancel()
        services.run_jobs.stop()
        await asyncio.gather(jobs, *background, return_exceptions=True)
        await services.aclose()


async def _run_jobs(services: Services) -> None:
    """Work at jobs until `RunJobs.stop`; whatever happens to one, the next is tried."""
    while not services.run_jobs.stopping:
        try:
            worked = await asyncio.to_thread(services.run_jobs.run_next)
        except RoboPromptError as error:
            logger.warning("jobs: %s", error)
            worked = False
        if not worked:
            await services.run_jobs.wait(JOB_POLL_S)


async def _warm_up(services: Services) -> None:
    try:
        await services.models.warm_up(services.default_model)
    except LanguageModelError as error:
        logger.warning("the default model is not available: %s", error)


def build_app(settings: Settings) -> FastAPI:
    """The ASGI application for these settings."""
    app = create_app(lambda: open_services(settings), version("roboprompt"), int(settings.max_body_mb * MEGABYTE))
    if settings.otel_endpoint:
        _trace(app, settings.otel_endpoint)
    return app


def _trace(app: FastAPI, endpoint: str) -> None:
    try:
        from app.telemetry import install_tracing
    except ModuleNotFoundError as error:
        raise SystemExit(f"{error}; ROBOPROMPT_OTEL_ENDPOINT needs `pip install roboprompt[otel]`") from error
    atexit.register(install_tracing(app, endpoint).shutdown)
