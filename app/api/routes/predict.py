"""Prediction: what the robot sees now -> what it should do."""

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse
from starlette.concurrency import run_in_threadpool

from app.api.body import Body, read_body
from app.api.documents import dry_run_document, prediction_document
from app.api.frames import decode_frames, split_images
from app.api.openapi import body_of
from app.api.routes import Wired, problems
from app.api.schemas.requests import PredictBody
from app.api.schemas.responses import DryRunOut, PredictionOut
from app.services.question import PredictRequest

router = APIRouter(tags=["predictions"])


@router.post(
    "/predict",
    operation_id="predict",
    response_model=PredictionOut | DryRunOut,
    openapi_extra=body_of(PredictBody, PredictBody),
    responses=problems(
        _400="the body cannot be read",
        _404="no such task or episode",
        _409="the task has no demonstrations yet",
        _413="the body is too large",
        _415="neither multipart nor JSON",
        _422="a value is not valid, or the objects are not those of the task",
        _502="the LLM failed, or its reply is not a list of valid actions (reply_text has it)",
        _503="the model or the store is not available",
        _504="the LLM did not answer in time",
    ),
)
async def predict(request: Request, services: Wired) -> Response:
    """Actions for the observed scene, by an LLM that continues the pattern of the demonstrations.

    JSON with the objects' poses; or multipart with the same document as part `metadata`, and the cameras' images as in
    an upload, for tasks whose pose estimator looks at images. Nothing is invented: a reply that is not a list of valid
    actions is an error, recorded with the prediction.
    """
    body = await read_body(request)
    # Images take long to decode; a JSON body does not repay the change of thread.
    wish, asked = await run_in_threadpool(_read, body) if body.parts else _read(body)
    if asked.dry_run:
        timings_ms: dict[str, float] = {}
        question = await services.predict_actions.prepare(wish, timings_ms)
        return JSONResponse(dry_run_document(question, timings_ms))
    return JSONResponse(prediction_document(await services.predict_actions(wish)))


def _read(body: Body) -> tuple[PredictRequest, PredictBody]:
    asked = PredictBody.model_validate(body.document)
    frames = decode_frames(asked.cameras, split_images(asked.cameras, body.parts))
    wish = PredictRequest(
        task=asked.task,
        instruction=asked.instruction,
        objects=tuple(item.query() for item in asked.objects),
        frames=frames,
        model=asked.model,
        representation=asked.representation,
        prompt_format=asked.prompt_format,
        system_prompt=asked.system_prompt,
        num_demonstrations=asked.num_demonstrations,
        selection=asked.selection,
        seed=asked.seed,
        episode_ids=None if asked.episode_ids is None else tuple(asked.episode_ids),
        max_actions=asked.max_actions,
        timeout_s=asked.timeout_s,
        as_sent=asked.model_dump(mode="json", exclude_unset=True),
    )
    return wish, asked
