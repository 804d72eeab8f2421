"""Prediction: what the robot sees now -> what it should do."""

import json
import re
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing

import anyio.to_thread
from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse
from fastapi.sse import EventSourceResponse, format_sse_event

from app.api.body import Body, read_body
from app.api.documents import dry_run_document, prediction_document, understood_document
from app.api.frames import decode_frames, decoded, split_images
from app.api.problems import problem_of
from app.api.routes import Wired, body_of, problems
from app.api.schemas.predictions import DryRunOut, PredictionOut
from app.api.schemas.requests import PredictBody
from app.llm.base import Reading, TextDelta
from app.services.container import Services
from app.services.predict.ask import Arriving
from app.services.predict.part_reply import PredictedAction
from app.services.predict.question import Question
from app.services.predict.record import Prediction
from app.services.predict.request import PredictRequest
from app.store.errors import StoreError
from app.store.values import JsonObject

EVENT_STREAM = "text/event-stream"
REFUSED_QUALITY = re.compile(r"q\s*=\s*0(\.0*)?")
STREAMED: dict[int | str, dict[str, object]] = {
    200: {"content": {EVENT_STREAM: {"schema": {"type": "string"}, "example": "event: action\ndata: {...}\n\n"}}}
}
router = APIRouter(tags=["predictions"])


@router.post(
    "/predict",
    response_model=PredictionOut | DryRunOut,
    openapi_extra=body_of(PredictBody),
    responses=STREAMED
    | problems(
        _404="no such task or episode",
        _409="the task has no demonstrations yet",
        _415="neither multipart nor JSON",
        _422="a value is not valid, or the objects are not those of the task",
        _502="the LLM failed, or its reply is not a list of valid actions, or one is unsafe (reply_text has it)",
        _503="the model or the store is not available",
        _504="the LLM did not answer in time",
    ),
)
async def predict(request: Request, services: Wired) -> Response:
    """Actions for the observed scene, by an LLM that continues the pattern of the demonstrations.

    JSON with the objects' poses; or multipart with the same document as part `metadata`, and the cameras' images as in
    an upload, for tasks whose pose estimator uses images. Nothing is invented: a reply that is not a list of valid
    actions is an error, recorded with the prediction.

    The service rewrites the instruction in the words of the demonstrations: `canonical_instruction` is what the LLM
    reads, and `grounding` names the object of each phrase. An instruction is refused if it names no object, if it fits
    several objects, or if no demonstration shows what it asks for. Without `task`, exactly one task must fit it.

    With `Accept: text/event-stream` the answer is a stream. The events `findings` (doubts) and `grounding` come first,
    then an event `action` for each action as soon as its row is complete, and at the end `done` with the whole
    document. If the reply fails in the middle, the stream ends with an event `error` that has a problem document; if
    the store failed, `actions_sent` in it is the number of actions that were sent but not `recorded`. With
    `stream_text`, events `text` have the pieces of the reply before they are checked, and events `progress` how much
    of the prompt the model has read, if the model reports it.
    """
    body = await read_body(request)
    streamed = _wants_events(request.headers.get("accept", ""))
    query, asked = await questioned(body, services)
    question = await services.predict_actions.prepare(query)
    del query  # what was decoded would fill the memory while the LLM is asked
    if asked.dry_run:
        return JSONResponse(dry_run_document(question))
    if streamed:
        answer = services.predict_actions.stream(question)
        # What fails before the first action is answered with its own status.
        first = await anext(answer)
        return EventSourceResponse(_events(request, question, first, answer))
    return JSONResponse(prediction_document(await services.predict_actions.complete(question)))


async def questioned(body: Body, services: Services) -> tuple[PredictRequest, PredictBody]:
    """Return the question of a body, with its task; the pages ask for it, too.

    Images are decoded in a thread, for which a small JSON body does not repay the change.
    """
    query, asked = await decoded(services, _read_question, body) if body.parts else _read_question(body)
    if asked.task is None:
        query = await anyio.to_thread.run_sync(services.read_steps.with_task, query)
    return query, asked


def _read_question(body: Body) -> tuple[PredictRequest, PredictBody]:
    """Return the question, checked and decoded; synchronous: call it in a thread if there are images."""
    asked = PredictBody.model_validate(body.document)
    images = split_images(asked.cameras, body.parts)
    query = PredictRequest(
        task=asked.task or "",
        instruction=asked.instruction,
        objects=tuple(item.query() for item in asked.objects),
        frames=decode_frames(asked.cameras, images),
        images=images,
        end_effector=None if asked.end_effector is None else asked.end_effector.pose(),
        options=asked,
        as_sent=asked.model_dump(mode="json", exclude_unset=True),
    )
    return query, asked


def _wants_events(accept: str) -> bool:
    """Whether the Accept header names the stream of events, and not only to refuse it (`q=0`)."""
    for item in accept.lower().split(","):
        media_type, *parameters = (word.strip() for word in item.split(";"))
        if media_type == EVENT_STREAM:
            return not any(REFUSED_QUALITY.fullmatch(word) for word in parameters)
    return False


_Item = Arriving | Prediction


async def _events(
    request: Request,
    question: Question,
    first: _Item,
    answer: AsyncGenerator[_Item, None],
) -> AsyncIterator[bytes]:
    """Yield the answer as server-sent events, first the findings of the scene."""
    sent = 0
    async with aclosing(answer):
        try:
            yield _event("findings", {"findings": [finding.to_json() for finding in question.findings]})
            yield _event("grounding", understood_document(question.grounded))
            sent += isinstance(first, PredictedAction)
            yield _event_of(first)
            async for item in answer:
                sent += isinstance(item, PredictedAction)
                yield _event_of(item)
        except Exception as error:  # the status is sent already: whatever goes wrong is said here
            document = json.loads(bytes(problem_of(request, error).body))
            if isinstance(error, StoreError):  # the robot may have moved, and nothing else remembers it
                document |= {"actions_sent": sent, "recorded": False}
            yield _event("error", document)


def _event(name: str, document: JsonObject) -> bytes:
    return format_sse_event(event=name, data_str=json.dumps(document))


def _event_of(item: _Item) -> bytes:
    match item:
        case TextDelta():
            return _event("text", {"text": item.text})
        case Reading():
            return _event("progress", {"tokens_read": item.tokens, "of": item.of})
        case PredictedAction():
            return _event("action", item.document)
        case Prediction():
            return _event("done", prediction_document(item))
