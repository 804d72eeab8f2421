"""Prediction: what the robot sees now -> what it should do."""

import json
import time
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse
from fastapi.sse import EventSourceResponse, format_sse_event
from starlette.concurrency import run_in_threadpool

from app.api.body import Body, read_body
from app.api.documents import dry_run_document, prediction_document
from app.api.frames import decode_frames, split_images
from app.api.openapi import body_of
from app.api.problems import own_problem
from app.api.routes import Wired, problems
from app.api.schemas.requests import PredictBody
from app.api.schemas.responses import DryRunOut, PredictionOut
from app.pipeline.errors import RoboPromptError
from app.services.predict_actions import PredictedAction, Prediction
from app.services.question import PredictRequest

EVENT_STREAM = "text/event-stream"
STREAMED: dict[int | str, dict[str, object]] = {
    200: {"content": {EVENT_STREAM: {"schema": {"type": "string"}, "example": "event: action\ndata: {...}\n\n"}}}
}
router = APIRouter(tags=["predictions"])


@router.post(
    "/predict",
    operation_id="predict",
    response_model=PredictionOut | DryRunOut,
    openapi_extra=body_of(PredictBody, PredictBody, packed=True),
    responses=STREAMED
    | problems(
        _400="the body cannot be read",
        _404="no such task or episode",
        _409="the task has no demonstrations yet",
        _413="the body is too large",
        _415="neither multipart, JSON nor MessagePack",
        _422="a value is not valid, or the objects are not those of the task",
        _502="the LLM failed, or its reply is not a list of valid actions (reply_text has it)",
        _503="the model or the store is not available",
        _504="the LLM did not answer in time",
    ),
)
async def predict(request: Request, services: Wired) -> Response:
    """Actions for the observed scene, by an LLM that continues the pattern of the demonstrations.

    JSON with the objects' poses; or multipart with the same document as part `metadata`, and the cameras' images as in
    an upload, for tasks whose pose estimator looks at images; or MessagePack with that document and the images beside
    it as arrays, `{"__ndarray__": true, "data": bytes, "dtype": "|u1", "shape": [480, 640, 3]}`. Nothing is invented: a
    reply that is not a list of valid actions is an error, recorded with the prediction.

    With `Accept: text/event-stream` each action comes as an event `action` as soon as its row is complete, then `done`
    with the whole document; an event `error` with a problem document ends a reply that goes wrong in the middle.
    """
    started_s = time.perf_counter()
    body = await read_body(request, packed=True)
    # Images take long to decode; a JSON body does not repay the change of thread.
    wish, asked = await run_in_threadpool(_read, body) if body.parts else _read(body)
    timings_ms: dict[str, float] = {}
    if asked.dry_run:
        question = await services.predict_actions.prepare(wish, timings_ms)
        return JSONResponse(dry_run_document(question, timings_ms))
    if EVENT_STREAM in request.headers.get("accept", ""):
        question = await services.predict_actions.prepare(wish, timings_ms)
        answer = services.predict_actions.answer(question, timings_ms, started_s, piecewise=True)
        # What fails before the first action is answered with its own status.
        return EventSourceResponse(_events(request, await anext(answer), answer))
    return JSONResponse(prediction_document(await services.predict_actions(wish)))


_Item = PredictedAction | Prediction


async def _events(request: Request, first: _Item, answer: AsyncGenerator[_Item, None]) -> AsyncIterator[bytes]:
    """The answer as server-sent events."""
    async with aclosing(answer):
        yield _event(first)
        try:
            async for item in answer:
                yield _event(item)
        except RoboPromptError as error:
            yield format_sse_event(event="error", data_str=bytes(own_problem(request, error).body).decode())


def _event(item: _Item) -> bytes:
    if isinstance(item, PredictedAction):
        return format_sse_event(event="action", data_str=json.dumps(item.to_json()))
    return format_sse_event(event="done", data_str=json.dumps(prediction_document(item)))


def _read(body: Body) -> tuple[PredictRequest, PredictBody]:
    asked = PredictBody.model_validate(body.document)
    images = split_images(asked.cameras, body.parts)
    wish = PredictRequest(
        task=asked.task,
        instruction=asked.instruction,
        objects=tuple(item.query() for item in asked.objects),
        frames=decode_frames(asked.cameras, images),
        images=images,
        model=asked.model,
        representation=asked.representation,
        prompt_format=asked.prompt_format,
        system_prompt=asked.system_prompt,
        num_demonstrations=asked.num_demonstrations,
        selection=asked.selection,
        seed=asked.seed,
        num_samples=asked.num_samples,
        temperature=asked.temperature,
        permute_demonstrations=asked.permute_demonstrations,
        episode_ids=None if asked.episode_ids is None else tuple(asked.episode_ids),
        closed_loop=asked.closed_loop,
        after=asked.after,
        max_actions=asked.max_actions,
        timeout_s=asked.timeout_s,
        as_sent=asked.model_dump(mode="json", exclude_unset=True),
    )
    return wish, asked
