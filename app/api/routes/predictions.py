"""Recorded predictions, and their outcomes; and the steps of a sentence over several tasks."""

from typing import Annotated

from fastapi import APIRouter, Body, Query, Response
from fastapi.responses import JSONResponse

from app.api.decoding import StrictJsonRoute
from app.api.documents import stored_prediction_document
from app.api.routes import Wired, problems
from app.api.schemas.lists import PredictionsQuery
from app.api.schemas.predictions import PlanOut, PredictionPage, StoredPrediction
from app.api.schemas.requests import OutcomeBody, PlanBody
from app.store import predictions

router = APIRouter(tags=["predictions"], route_class=StrictJsonRoute)


@router.get("/predictions", response_model=PredictionPage)
def list_predictions(services: Wired, query: Annotated[PredictionsQuery, Query()]) -> Response:
    """Predictions, newest first, failed ones included."""
    with services.store.read() as connection:
        page = predictions.list_page(connection, query.filter(), query.limit, query.cursor)
    documents = [stored_prediction_document(record) for record in page.items]
    return JSONResponse({"predictions": documents, "next_cursor": page.next_cursor})


@router.get(
    "/predictions/{prediction_id}", response_model=StoredPrediction, responses=problems(_404="no such prediction")
)
def get_prediction(services: Wired, prediction_id: str) -> Response:
    """One prediction with its prompt and reply."""
    with services.store.read() as connection:
        record = predictions.get(connection, prediction_id)
    return JSONResponse(stored_prediction_document(record))


@router.delete("/predictions/{prediction_id}", status_code=204, responses=problems(_404="no such prediction"))
def delete_prediction(services: Wired, prediction_id: str) -> Response:
    """Delete a prediction and its outcome; its images go with a later sweep, if nothing else has them.

    An episode that carried it out keeps its id.
    """
    with services.store.write() as connection:
        predictions.remove(connection, prediction_id)
    return Response(status_code=204)


@router.post(
    "/predictions/{prediction_id}/outcome",
    response_model=StoredPrediction,
    responses=problems(_404="no such prediction"),
)
def record_outcome(services: Wired, prediction_id: str, outcome: OutcomeBody) -> Response:
    """Report whether the robot succeeded; a later outcome replaces an earlier one.

    This needs the key that asked for the prediction, or one with the scope `admin`.
    """
    with services.store.write() as connection:
        record = predictions.record_outcome(connection, prediction_id, outcome.success, outcome.note)
    services.metrics.observe_outcome(record.model, success=outcome.success)
    return JSONResponse(stored_prediction_document(record))


@router.post(
    "/plans",
    response_model=PlanOut,
    responses=problems(_422="a value is not valid, or a part of the instruction is not what one task does"),
)
def plan(services: Wired, body: Annotated[PlanBody, Body()]) -> Response:
    """Split a sentence over several tasks into steps, for example "open the top drawer, put the red mug in it".

    Send each step to `POST /predict` after the step before is done, with a new observation. No step is invented and
    none is left out: a sentence is refused if a word fits no task, if "it" may mean two objects, or if several tasks
    can do a step. No LLM is asked and nothing is stored.
    """
    steps = services.read_steps(body.instruction, [item.query() for item in body.objects])
    return JSONResponse({"steps": [step._asdict() for step in steps]})
