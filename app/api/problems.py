"""Errors -> `application/problem+json` (RFC 9457), mapped once."""

import json
import logging
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from app.llm.base import LanguageModelError, ModelBusyError, ModelTimeoutError, ModelUnavailableError, UnknownModelError
from app.perception.remote import PoseServerError, PoseServerTimeoutError, PoseServerUnavailableError
from app.pipeline.errors import (
    ObjectNotVisibleError,
    ObjectSetError,
    ReplyParseError,
    SceneOutOfBoundsError,
    UncertainPoseError,
    UnfamiliarInstructionError,
    UngroundedInstructionError,
    UnsupportedActionError,
)
from app.services.errors import NoDemonstrationsError, RefusedReplyError
from app.store.errors import (
    ConflictError,
    CorruptDataError,
    NotFoundError,
    StoreError,
    StoreUnavailableError,
)
from roboprompt_client.errors import InvalidInputError, RoboPromptError, UnsafeActionError

MEDIA_TYPE = "application/problem+json"
CONTENT: dict[str, Any] = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}  # in the OpenAPI document
# What an error repeats of a request: characters of a bad value, of a field's name, of a message; and how many errors.
MAX_SHOWN = 120
MAX_FIELD_CHARS = 200
MAX_MESSAGE_CHARS = 2000
MAX_ERRORS = 20
logger = logging.getLogger(__name__)


class Kind(NamedTuple):
    """How a class of errors is answered."""

    status: int
    type: str
    title: str


_INTERNAL = Kind(500, "internal-error", "The service failed")
# An error is answered as the nearest of its classes says.
KINDS: Mapping[type[Exception], Kind] = {
    InvalidInputError: Kind(422, "invalid-input", "A value is not valid"),
    ObjectSetError: Kind(422, "object-set", "The objects are not those of the task"),
    SceneOutOfBoundsError: Kind(422, "scene-out-of-bounds", "Every demonstrated plan leaves the workspace here"),
    ObjectNotVisibleError: Kind(422, "object-not-visible", "No camera sees an object"),
    UncertainPoseError: Kind(422, "uncertain-pose", "The images do not show an object's pose"),
    UngroundedInstructionError: Kind(422, "ungrounded-instruction", "It is not clear which object is meant"),
    UnfamiliarInstructionError: Kind(422, "unfamiliar-instruction", "The instruction is unlike what was taught"),
    PoseServerUnavailableError: Kind(503, "pose-server-unavailable", "The pose server cannot be reached"),
    PoseServerTimeoutError: Kind(504, "pose-server-timeout", "The pose server did not answer in time"),
    PoseServerError: Kind(502, "pose-server-error", "The pose server's answer cannot be used"),
    NoDemonstrationsError: Kind(409, "no-demonstrations", "The task has no demonstrations"),
    ReplyParseError: Kind(502, "unparsable-reply", "The model's reply is not a list of valid actions"),
    UnsafeActionError: Kind(502, "unsafe-action", "The model's reply breaks a bound of motion"),
    UnsupportedActionError: Kind(502, "unsupported", "The demonstrations do not support the reply"),
    UnknownModelError: Kind(422, "unknown-model", "There is no such model"),
    ModelUnavailableError: Kind(503, "model-unavailable", "The model cannot be used here"),
    ModelBusyError: Kind(503, "model-busy", "The model has too many requests under way"),
    ModelTimeoutError: Kind(504, "model-timeout", "The LLM did not answer in time"),
    LanguageModelError: Kind(502, "model-error", "The LLM answered with an error"),
    NotFoundError: Kind(404, "not-found", "Not found"),
    ConflictError: Kind(409, "conflict", "The request contradicts what is stored"),
    StoreUnavailableError: Kind(503, "store-unavailable", "The store does not answer"),
    CorruptDataError: Kind(500, "corrupt-data", "Stored data is damaged"),
    RoboPromptError: _INTERNAL,
}
_HTTP_TITLES = {
    400: "The request cannot be read",
    404: "There is no such address",
    405: "This address has other methods",
    413: "The request is too large",
    415: "The content type is not understood",
    499: "The client has left",
}
# Pydantic's types of errors, where its own words would not say to a caller over HTTP what is wrong or what is valid
_MESSAGES = {
    "missing": ("is missing", "a value as in /docs"),
    "extra_forbidden": ("is not a known field", "the fields in /docs"),
}
_OBJECT = "a JSON object, sent as application/json"
_VALID = {
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "an object",
    "model_type": _OBJECT,
    "model_attributes_type": _OBJECT,
    "string_type": "a text",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
}
_REQUIREMENT = re.compile(r"\w+ should (?:be|have) (.+?)(?: after validation, not .*)?", re.DOTALL)


def install_problem_handlers(app: FastAPI) -> None:
    """Let `app` answer every error as a problem."""
    kinds = (RoboPromptError, RequestValidationError, ValidationError, HTTPException)
    for kind in (*kinds, RecursionError, ClientDisconnect, Exception):
        app.add_exception_handler(kind, problem_of)


def problem_of(request: Request, error: Exception) -> JSONResponse:
    """The response for any error."""
    match error:
        case RoboPromptError():
            return _own_problem(request, error)
        case HTTPException(status_code=404, detail="Not Found"):  # the router's own
            return http_problem(HTTPException(404, f"{request.url.path[:MAX_SHOWN]!r}: see /docs for the addresses"))
        case HTTPException(status_code=405, headers=headers):
            allowed = _methods_of(request, (headers or {}).get("Allow", ""))
            said = f"{request.method} is not valid here; valid: {allowed}"
            return http_problem(HTTPException(405, said, {"Allow": allowed}))
        case HTTPException():
            return http_problem(error)
        case RequestValidationError() | ValidationError():
            return _validation_problem(error)
        case RecursionError():
            return http_problem(HTTPException(400, "the body is nested too deeply"))
        case ClientDisconnect():  # the answer reaches no client, but the log must not call it a failure of the service
            return http_problem(HTTPException(499, "the client has left before its request was complete"))
        case _:
            logger.error("%s %s failed", request.method, request.url.path, exc_info=error)
            return problem(_INTERNAL, "An unexpected error; the service's log has the details.")


def _methods_of(request: Request, of_one_route: str) -> str:
    """The methods that the request's address has: the document of the service has all of its routes."""
    route = getattr(request.scope.get("route"), "path", None)
    methods = request.app.openapi()["paths"].get(route, ())
    return ", ".join(sorted(method.upper() for method in methods)) or of_one_route


def problem(
    kind: Kind,
    detail: str,
    errors: Sequence[Mapping[str, Any]] = (),
    headers: Mapping[str, str] | None = None,
    **extra: object,
) -> JSONResponse:
    """The response for an error.

    Args:
        extra: further members of the document.
    """
    content = {
        "type": f"/problems/{kind.type}",
        "title": kind.title,
        "status": kind.status,
        "detail": _short(detail),
        "errors": [_short_entry(entry) for entry in errors[:MAX_ERRORS]],
        **extra,
    }
    return JSONResponse(content, kind.status, dict(headers or {}), media_type=MEDIA_TYPE)


def http_problem(error: HTTPException) -> JSONResponse:
    """The response for an error of the web's own."""
    title = _HTTP_TITLES.get(error.status_code, "The request cannot be answered")
    kind = Kind(error.status_code, "too-large" if error.status_code == 413 else "http", title)
    return problem(kind, str(error.detail), headers=error.headers)


def store_problem(error: StoreError) -> JSONResponse:
    """The response where not even the keys can be read."""
    kind = KINDS[StoreUnavailableError] if isinstance(error, StoreUnavailableError) else _INTERNAL
    logger.warning("the API keys cannot be read: %s", error)
    return problem(kind, "the API keys cannot be read", headers={"Retry-After": "1"})


def _own_problem(request: Request, error: RoboPromptError) -> JSONResponse:
    named = error.cause if isinstance(error, RefusedReplyError) else error
    kind = next(KINDS[cls] for cls in type(named).__mro__ if cls in KINDS)
    if kind.status >= 500:
        logger.warning("%s %s: %s: %s", request.method, request.url.path, type(error).__name__, error)
    reply: dict[str, object] = {}
    if isinstance(error, RefusedReplyError):
        reply = {"reply_text": error.reply_text, "prediction_id": error.prediction_id}
    wait_s = getattr(error, "retry_after_s", None) or 1.0
    headers = {"Retry-After": str(math.ceil(wait_s))} if kind.status == 503 else None
    return problem(kind, str(error), _own_entries(named), headers, **reply)


def _own_entries(error: RoboPromptError) -> list[dict[str, Any]]:
    """Return the wrong fields, as far as the error names them."""
    match error:
        case InvalidInputError():
            return [_entry(error.field, error.message, error.valid)]
        case UnknownModelError():
            return [_entry("model", str(error))]
        case UnsafeActionError():
            return [_entry(error.field, error.message, error.bound)]
        case UnsupportedActionError():
            return [_entry(error.field, error.message, error.expected)]
        case _:
            return []


def _validation_problem(error: RequestValidationError | ValidationError) -> JSONResponse:
    found = error.errors()
    # FastAPI's errors begin with the part of the request: body, query, path or header
    skipped = 1 if isinstance(error, RequestValidationError) else 0
    refusals = [_refusal(item, item["loc"][skipped:]) for item in found[:MAX_ERRORS]]
    first = f"the first {MAX_ERRORS} of {len(found)} errors: " if len(found) > MAX_ERRORS else ""
    entries = [_short_entry(_entry(refusal.field, refusal.message, refusal.valid)) for refusal in refusals]
    said = [str(InvalidInputError(**entry)) for entry in entries]
    return problem(KINDS[InvalidInputError], first + "; ".join(said), entries)


def _refusal(item: Mapping[str, Any], location: Sequence[str | int]) -> InvalidInputError:
    """Return one of pydantic's errors in the words of this service: the field, its value and what is valid."""
    context = item.get("ctx", {})
    if isinstance(own := context.get("error"), InvalidInputError):
        return own
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".") or "body"
    if item["type"] in _MESSAGES:
        return InvalidInputError(field, *_MESSAGES[item["type"]])
    text = item["msg"].removeprefix("Value error, ")
    requirement = _REQUIREMENT.fullmatch(text)
    valid = context.get("expected") or _VALID.get(item["type"]) or (requirement and requirement[1])
    shown = _shown(item.get("input"))
    return InvalidInputError(field, f"is {shown}" if valid else f"{text}, got {shown}", valid)


def _shown(value: object) -> str:
    match value:
        case dict():
            return "an object"
        case list() | tuple():
            return f"a list of {len(value)}"
        case str() | bytes():  # only its beginning is copied: it may be long
            return repr(value[:MAX_SHOWN])[:MAX_SHOWN]
        case None | True | False:
            return json.dumps(value)
        case _:
            return repr(value)[:MAX_SHOWN]


def _entry(field: str, message: str, valid: str | None = None) -> dict[str, Any]:
    return {"field": field, "message": message, "valid": valid}


def _short_entry(entry: Mapping[str, Any]) -> dict[str, Any]:
    lengths = {"field": MAX_FIELD_CHARS, "message": MAX_MESSAGE_CHARS, "valid": MAX_MESSAGE_CHARS}
    return {name: _short(value, lengths[name]) if isinstance(value, str) else value for name, value in entry.items()}


def _short(text: str, most: int = MAX_MESSAGE_CHARS) -> str:
    return text if len(text) <= most else f"{text[:most]}..."
