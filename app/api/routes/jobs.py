"""Jobs: re-extractions too large for one request."""

from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import JSONResponse

from app.api.documents import job_document
from app.api.routes import Cursor, Limit, Wired, problems
from app.api.schemas.responses import JobOut, JobPage
from app.store import jobs

router = APIRouter(tags=["tasks"])


@router.get("/jobs", operation_id="list_jobs", response_model=JobPage, responses=problems(_422="a value is not valid"))
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


@router.get("/jobs/{job_id}", operation_id="get_job", response_model=JobOut, responses=problems(_404="no such job"))
def get_job(services: Wired, job_id: str) -> Response:
    """How far a job is."""
    with services.store.read() as connection:
        record = jobs.get(connection, job_id)
    return JSONResponse(job_document(record))
