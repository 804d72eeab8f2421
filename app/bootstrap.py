"""Choose the parts and wire them; no other module does."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable
from datetime import timedelta
from functools import partial

from fastapi import FastAPI

from app.api.access import Access
from app.api.app import create_app
from app.api.middleware import BodyLimits
from app.llm.registry import ModelRegistry
from app.logs import Tracing, hide_keys_in_access_log, show_changes
from app.services.api_keys import has_keys
from app.services.container import Services
from app.services.limits import Limits
from app.services.poses import PoseServers
from app.settings import MEGA, Settings
from app.store.erasure import keep_house
from app.store.store import SWEEP_GRACE, Store
from app.web.routes import install_pages
from roboprompt_client.errors import RoboPromptError
from roboprompt_client.http import is_loopback
from roboprompt_client.version import VERSION

DEFAULT_RATE_PER_S = 20.0
HOUSEKEEPING_S = SWEEP_GRACE.total_seconds() + 60

logger = logging.getLogger(__name__)


def open_store(settings: Settings) -> Store:
    """The store of these settings, as `Store.open` opens it. Blocking."""
    connections = settings.database_connections
    return Store.open(settings.data, settings.database_url, settings.blobs_url, server_connections=connections)


@contextlib.asynccontextmanager
async def open_services(settings: Settings) -> AsyncIterator[Services]:
    """Open the store, sweep what earlier crashes left, start the default model in the background; close all at the end.

    Raises:
        StoreError: if the data folder cannot be used.
    """
    store = await asyncio.to_thread(open_store, settings)
    if access_for(settings).key_required and not await asyncio.to_thread(has_keys, store):
        logger.warning("API keys are required, but none exists: roboprompt keys add NAME --scope admin")
    kept = settings.embedded_kept_folder or settings.data / "prefixes"
    services = Services(
        store,
        ModelRegistry(settings.model_copy(update={"embedded_kept_folder": kept})),
        settings.default_model,
        _limits_for(settings),
        PoseServers(settings.pose_servers),
        num_warm_tasks=settings.embedded_slots,
    )
    background: list[asyncio.Task[object]] = [asyncio.create_task(_keep_house(store, settings))]
    if settings.warm_up:
        background.append(asyncio.create_task(services.prefix_warmer.run()))
    try:
        yield services
    finally:
        for task in background:
            task.cancel()
        await asyncio.gather(*background, return_exceptions=True)
        await services.aclose()


async def _keep_house(store: Store, settings: Settings) -> None:
    """Delete what the settings do not keep now and every hour, until cancelled."""
    days, gigabytes = settings.keep_predictions_days, settings.keep_predictions_gb
    max_age = None if days is None else timedelta(days=days)
    max_bytes = None if gigabytes is None else int(gigabytes * 1000 * MEGA)
    while True:
        await _tried("housekeeping", partial(keep_house, store, max_age, max_bytes))
        await asyncio.sleep(HOUSEKEEPING_S)


async def _tried(what: str, work: Callable[[], int]) -> int:
    """Return what `work` does in a thread. An error is logged: the next attempt must not wait for a restart."""
    try:
        return await asyncio.to_thread(work)
    except RoboPromptError as error:
        logger.warning("%s: %s", what, error)
    except Exception:  # e.g. no memory
        logger.exception(what)
    return 0


def _limits_for(settings: Settings) -> Limits:
    """Return how much a request may ask for."""
    return Limits(
        max_image_pixels=int(settings.max_image_megapixels * MEGA),
        max_request_pixels=int(settings.max_request_megapixels * MEGA),
        max_unpacked_bytes=int(settings.max_unpacked_mb * MEGA),
        max_frames=settings.max_frames,
        max_prompt_chars=settings.max_prompt_chars,
        allowed_models=settings.allowed_models,
        model_files=_is_local(settings) and settings.auth != "on",
    )


def access_for(settings: Settings) -> Access:
    """Return the rules for requests."""
    local = _is_local(settings)
    required = settings.auth == "on" or (settings.auth == "auto" and not local)
    rate = settings.rate_limit_per_s
    return Access(
        key_required=required,
        local_only=settings.auth == "auto" and local,
        requests_per_s=rate if rate is not None else DEFAULT_RATE_PER_S if required else 0.0,
        burst=settings.rate_limit_burst,
        max_query_chars=settings.max_query_chars,
    )


def _is_local(settings: Settings) -> bool:
    return settings.host is not None and is_loopback(settings.host)


def build_app(settings: Settings) -> FastAPI:
    """The ASGI application for these settings: the API and the pages."""
    hide_keys_in_access_log()
    show_changes()
    access = access_for(settings)
    tracing = _tracing(settings.otel_endpoint)
    megabytes = (settings.max_body_mb, settings.max_inline_mb, settings.max_document_mb, settings.max_held_mb)
    body_limits = BodyLimits(*(int(size * MEGA) for size in megabytes))
    app = create_app(lambda: _traced(tracing, settings), VERSION, body_limits, access)
    install_pages(app)
    if tracing:
        tracing.install(app)
    return app


def _tracing(endpoint: str | None) -> Tracing | None:
    try:
        return Tracing(endpoint) if endpoint else None
    except ModuleNotFoundError as error:
        raise SystemExit(f"{error}; ROBOPROMPT_OTEL_ENDPOINT needs `pip install roboprompt[otel]`") from error


@contextlib.asynccontextmanager
async def _traced(tracing: Tracing | None, settings: Settings) -> AsyncIterator[Services]:
    """`open_services`, and at its end the last traces are sent."""
    try:
        async with open_services(settings) as services:
            yield services
    finally:
        if tracing:
            await asyncio.to_thread(tracing.close)
