"""The service itself: its jobs, the LLMs that can be asked, whether it lives and is ready, and figures for Prometheus.

A job is a re-extraction too large for one request.
"""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import JSONResponse

from app.api.documents import job_document, model_document
from app.api.routes import Cursor, Limit, Wired, problems
from app.api.schemas.responses import Health, JobOut, JobPage, ModelList
from app.llm.base import LanguageModelError
from app.services.container import Services
from app.store import jobs
from app.store.errors import StoreError

router = APIRouter()


@router.get(
    "/jobs",
    operation_id="list_jobs",
    tags=["tasks"],
    response_model=JobPage,
    responses=problems(_422="a value is not valid"),
)
def list_jobs(
    services: Wired,
    task: Annotated[str | None, Query(max_length=64, description="only of this task")] = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> Response:
    """Jobs, newest first."""
    with services.store.read() as connection:
        page = jobs.list_page(connection, task, limit, cursor)
    return JSONResponse({"jobs": [job_document(record) for record in page.items], "next_cursor": page.next_cursor})


@router.get(
    "/jobs/{job_id}",
    operation_id="get_job",
    tags=["tasks"],
    response_model=JobOut,
    responses=problems(_404="no such job"),
)
def get_job(services: Wired, job_id: str) -> Response:
    """How far a job is."""
    with services.store.read() as connection:
        record = jobs.get(connection, job_id)
    return JSONResponse(job_document(record))


@router.get("/models", operation_id="list_models", tags=["models"], response_model=ModelList)
def list_models(services: Wired) -> Response:
    """Every LLM that the service knows, whether it can be used here, and the prompt that suits it."""
    known = services.models.profiles()
    documents = [model_document(item.profile, item.available, item.reason, services.default_model) for item in known]
    return JSONResponse({"models": documents})


@router.get("/healthz", operation_id="healthz", tags=["health"], response_model=Health)
async def healthz() -> Response:
    """The process answers."""
    return JSONResponse({"status": "ok", "checks": {}})


@router.get(
    "/readyz",
    operation_id="readyz",
    tags=["health"],
    response_model=Health,
    responses={503: {"model": Health, "description": "not ready; checks say why"}},
)
def readyz(request: Request, services: Wired) -> Response:
    """The store answers and the default model can be asked. Only callers who may read learn why not."""
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


@router.get("/metrics", operation_id="metrics", tags=["health"], responses={200: {"content": {"text/plain": {}}}})
def metrics(services: Wired) -> Response:
    """Requests, predictions by stage, tokens (cached among them), parse failures and outcomes, of this process."""
    return Response(services.metrics.text(), media_type=services.metrics.content_type)
