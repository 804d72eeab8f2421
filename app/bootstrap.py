"""Choose the parts and wire them; no other module does."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator

from fastapi import FastAPI

from app.api.access import Access
from app.api.app import create_app
from app.llm.registry import ModelRegistry
from app.logs import set_up_logs
from app.services.api_keys import has_keys
from app.services.container import Services
from app.services.offered_models import OfferedModels
from app.services.poses import PoseServers
from app.settings import Settings
from app.store.store import SWEEP_GRACE, Store
from app.web.routes import install_pages
from roboprompt_client.errors import RoboPromptError
from roboprompt_client.version import VERSION

DEFAULT_RATE_PER_S = 20.0
MEGABYTE = 1_000_000
SWEEP_EVERY_S = SWEEP_GRACE.total_seconds() + 60

logger = logging.getLogger(__name__)


def open_store(settings: Settings) -> Store:
    """The store of these settings, as `Store.open` opens it. Blocking."""
    return Store.open(settings.data, settings.database_url, settings.blobs_url)


@contextlib.asynccontextmanager
async def open_services(settings: Settings) -> AsyncIterator[Services]:
    """Open the store, sweep what earlier crashes left, start the default model in the background; close all at the end.

    Raises:
        StoreError: if the data folder cannot be used.
    """
    store = await asyncio.to_thread(open_store, settings)
    if access_for(settings).key_required and not await asyncio.to_thread(has_keys, store):
        logger.warning("API keys are required, but none exists: roboprompt keys add NAME --scope admin")
    services = Services(
        store,
        ModelRegistry(settings),
        settings.default_model,
        OfferedModels(settings.allowed_models, files=settings.auth == "local"),
        PoseServers(settings.pose_servers),
        num_warm_tasks=settings.embedded_slots,
    )
    background: list[asyncio.Task[object]] = [asyncio.create_task(_sweep(store))]
    if settings.warm_up:
        background.append(asyncio.create_task(services.prefix_warmer.run()))
    try:
        yield services
    finally:
        for task in background:
            task.cancel()
        await asyncio.gather(*background, return_exceptions=True)
        await services.aclose()


async def _sweep(store: Store) -> None:
    """Remove images that nothing refers to, now and every hour, until cancelled.

    An error is logged: the next attempt must not wait for a restart.
    """
    while True:
        try:
            await asyncio.to_thread(store.sweep_once)
        except RoboPromptError as error:
            logger.warning("sweep: %s", error)
        except Exception:  # e.g. no memory
            logger.exception("sweep")
        await asyncio.sleep(SWEEP_EVERY_S)


def access_for(settings: Settings) -> Access:
    """Return the rules for requests."""
    required = settings.auth in ("on", "auto")
    rate = settings.rate_limit_per_s
    return Access(
        key_required=required,
        local_only=settings.auth == "local",
        requests_per_s=rate if rate is not None else DEFAULT_RATE_PER_S if required else 0.0,
    )


def build_app(settings: Settings) -> FastAPI:
    """The ASGI application for these settings: the API and the pages."""
    set_up_logs()
    max_body_bytes = int(settings.max_body_mb * MEGABYTE)
    app = create_app(lambda: open_services(settings), VERSION, max_body_bytes, access_for(settings))
    install_pages(app)
    return app
