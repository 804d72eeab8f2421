"""Robots under way: they say where they are, and the answers say whether somebody stopped them."""

from typing import Annotated

from fastapi import APIRouter, Path, Response
from fastapi.responses import JSONResponse

from app.api.decoding import UniqueKeysRoute
from app.api.documents import run_document
from app.api.routes import Wired, problems
from app.api.schemas.requests import RunBody
from app.api.schemas.responses import RunAnswer, RunList, RunOut
from app.store import runs

router = APIRouter(tags=["runs"], route_class=UniqueKeysRoute)
RunId = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="32 hexadecimal digits of the robot's choice")]


@router.put(
    "/runs/{run_id}",
    operation_id="report_run",
    response_model=RunAnswer,
    responses=problems(_404="no such task, or the run is another key's", _422="a value is not valid"),
)
def report_run(services: Wired, run_id: RunId, body: RunBody) -> Response:
    """Where a robot is with what it carries out, five times a second; the answer says whether it shall stop.

    A run that was stopped stays stopped: the next one has another id.
    """
    state = body.model_dump(mode="json", exclude={"task"}, exclude_none=True)
    with services.store.write() as connection:
        stop = runs.report(connection, run_id, body.task, state)
    return JSONResponse({"stop": stop})


@router.delete(
    "/runs/{run_id}", operation_id="end_run", response_model=RunAnswer, responses=problems(_404="no such run")
)
def end_run(services: Wired, run_id: RunId) -> Response:
    """The robot is done; the answer says whether somebody stopped it meanwhile.

    Without this the run is forgotten a minute after its last word.
    """
    with services.store.write() as connection:
        stop = runs.end(connection, run_id)
    return JSONResponse({"stop": stop})


@router.get("/runs", operation_id="list_runs", response_model=RunList)
def list_runs(services: Wired) -> Response:
    """The robots under way that the key may see."""
    with services.store.read() as connection:
        records = runs.living(connection)
    return JSONResponse({"runs": [run_document(record) for record in records]})


@router.post(
    "/runs/{run_id}/stop", operation_id="stop_run", response_model=RunOut, responses=problems(_404="no such run")
)
def stop_run(services: Wired, run_id: RunId) -> Response:
    """Stop the robot: the answer to its next report says so. This replaces no emergency stop."""
    with services.store.write() as connection:
        record = runs.stop(connection, run_id)
    return JSONResponse(run_document(record))
