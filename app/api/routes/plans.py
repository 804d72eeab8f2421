"""Sentences about several tasks: what a robot is to ask for, one after the other."""

from typing import Annotated

from fastapi import APIRouter, Body, Response
from fastapi.responses import JSONResponse

from app.api.decoding import UniqueKeysRoute
from app.api.routes import Wired, problems
from app.api.schemas.predictions import PlanOut
from app.api.schemas.requests import PlanBody

router = APIRouter(tags=["predictions"], route_class=UniqueKeysRoute)


@router.post(
    "/plans",
    operation_id="plan",
    response_model=PlanOut,
    responses=problems(_422="a value is not valid, or a part of the instruction is not what one task does"),
)
def plan(services: Wired, body: Annotated[PlanBody, Body()]) -> Response:
    """The steps of a sentence over tasks that were taught apart, as "open the top drawer, put the red mug in it".

    Each step is in the words of its task, for `POST /predict` once the step before is done and the scene was looked at
    again. No step is made up and none is left out: a sentence with a word that finds no place, an "it" that may be two
    things, or a step that two tasks may do is refused. No LLM is asked and nothing is stored.
    """
    services.limits.check_scene(None, body.instruction, [item.name for item in body.objects], ())
    steps = services.read_steps(body.instruction, [item.query() for item in body.objects])
    return JSONResponse({"steps": [step._asdict() for step in steps]})
