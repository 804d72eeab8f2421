"""Whether the service lives and is ready."""

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from app.api.routes import Wired
from app.api.schemas.responses import Health
from app.llm.base import LanguageModelError
from app.services.container import Services
from app.store.errors import StoreError

router = APIRouter(tags=["health"])


@router.get("/healthz", operation_id="healthz", response_model=Health)
async def healthz() -> Response:
    """The process answers."""
    return JSONResponse({"status": "ok", "checks": {}})


@router.get(
    "/readyz",
    operation_id="readyz",
    response_model=Health,
    responses={503: {"model": Health, "description": "not ready; checks say why"}},
)
def readyz(request: Request, services: Wired) -> Response:
    """The store answers and the default model can be asked. Why not is said to those who may read, not to anybody."""
    checks = {"store": _store(services), "model": _model(services)}
    ready = all(state == "ok" for state in checks.values())
    if not request.state.known:
        checks = {name: state if state == "ok" else "not available" for name, state in checks.items()}
    return JSONResponse({"status": "ok" if ready else "starting", "checks": checks}, 200 if ready else 503)


def _store(services: Services) -> str:
    try:
        services.store.ping()
    except StoreError as error:
        return str(error)
    return "ok"


def _model(services: Services) -> str:
    try:
        services.models.profile(services.default_model)
    except LanguageModelError as error:
        return str(error)
    return "ok"
