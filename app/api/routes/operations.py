"""Models, health and metrics."""

import logging
from collections.abc import Callable

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse

from app.api.decoding import StrictJsonRoute
from app.api.documents import answer
from app.api.routes import Wired
from app.api.schemas.responses import Health, ModelList, ModelOut
from app.llm.base import LanguageModelError
from app.store.errors import StoreError

logger = logging.getLogger(__name__)
router = APIRouter(route_class=StrictJsonRoute)


@router.get("/models", tags=["models"], response_model=ModelList)
def list_models(services: Wired) -> Response:
    """Every LLM that the service knows, whether it is available, and its default prompt settings."""
    documents = []
    for item in services.models.profiles():
        default = item.profile.name == services.default_model
        known = {"available": item.available, "reason": item.reason or None, "default": default}
        documents.append(answer(ModelOut, item.profile, **known))
    return JSONResponse({"models": documents})


@router.get("/healthz", tags=["health"], response_model=Health)
async def healthz() -> Response:
    """Answer while the process runs."""
    return JSONResponse({"status": "ok", "checks": {}})


@router.get(
    "/readyz",
    tags=["health"],
    response_model=Health,
    responses={503: {"model": Health, "description": "not ready; checks say what"}},
)
def readyz(services: Wired) -> Response:
    """Whether the store answers and the default model is available; the service's log says why not."""
    checks = {
        "store": _state("store", services.store.ping),
        "model": _state("model", lambda: services.models.profile(services.default_model)),
    }
    ready = all(state == "ok" for state in checks.values())
    return JSONResponse({"status": "ok" if ready else "starting", "checks": checks}, 200 if ready else 503)


def _state(name: str, ask: Callable[[], object]) -> str:
    """Return whether it is there, in words; reasons name places of this machine, and strangers may ask."""
    try:
        ask()
    except (StoreError, LanguageModelError) as error:
        logger.warning("%s: %s", name, error)
        return "not available"
    return "ok"


@router.get("/metrics", tags=["health"], responses={200: {"content": {"text/plain": {}}}})
def metrics(services: Wired) -> Response:
    """Prometheus metrics of this process: requests, stages of predictions, tokens, parse failures and outcomes."""
    return Response(services.metrics.text(), media_type=services.metrics.content_type)
