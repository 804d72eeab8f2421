"""Errors -> `application/problem+json` (RFC 9457), mapped once."""

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import ValidationError
from starlette.exceptions import HTTPException

from app.llm.base import (
    LanguageModelError,
    ModelBusyError,
    ModelResponseError,
    ModelTimeoutError,
    ModelUnavailableError,
    UnknownModelError,
)
from app.perception.errors import (
    PoseServerError,
    PoseServerReplyError,
    PoseServerTimeoutError,
    PoseServerUnavailableError,
)
from app.pipeline.errors import (
    InvalidInputError,
    ObjectNotVisibleError,
    ObjectSetError,
    RoboPromptError,
    UncertainPoseError,
)
from app.services.errors import (
    NoDemonstrationsError,
    UnparsableReplyError,
    UnsafeReplyError,
    UnsupportedReplyError,
)
from app.store.errors import ConflictError, CorruptDataError, NotFoundError, StoreError, StoreUnavailableError

MEDIA_TYPE = "application/problem+json"
MAX_SHOWN = 120  # characters of a bad value that an error repeats
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Kind:
    """How a class of errors is answered."""

    status: int
    type: str
    title: str


_INTERNAL = Kind(500, "internal-error", "The service failed")
# An error is answered as the nearest of its classes says.
KINDS: Mapping[type[Exception], Kind] = {
    InvalidInputError: Kind(422, "invalid-input", "A value is not valid"),
    ObjectSetError: Kind(422, "object-set", "The objects are not those of the task"),
    ObjectNotVisibleError: Kind(422, "object-not-visible", "No camera sees an object"),
    UncertainPoseError: Kind(422, "uncertain-pose", "An object's pose cannot be told from the images"),
    PoseServerUnavailableError: Kind(503, "pose-server-unavailable", "The pose server cannot be reached"),
    PoseServerTimeoutError: Kind(504, "pose-server-timeout", "The pose server did not answer in time"),
    PoseServerReplyError: Kind(502, "pose-server-error", "The pose server's answer cannot be used"),
    PoseServerError: Kind(502, "pose-server-error", "The pose server's answer cannot be used"),
    NoDemonstrationsError: Kind(409, "no-demonstrations", "The task has no demonstrations"),
    UnparsableReplyError: Kind(502, "unparsable-reply", "The model's reply is not a list of valid actions"),
    UnsafeReplyError: Kind(502, "unsafe-action", "The model's reply breaks a bound of motion"),
    UnsupportedReplyError: Kind(502, "unsupported", "The demonstrations do not support the reply"),
    UnknownModelError: Kind(422, "unknown-model", "There is no such model"),
    ModelUnavailableError: Kind(503, "model-unavailable", "The model cannot be used here"),
    ModelBusyError: Kind(503, "model-busy", "The model has too many requests under way"),
    ModelTimeoutError: Kind(504, "model-timeout", "The LLM did not answer in time"),
    ModelResponseError: Kind(502, "model-error", "The LLM answered with an error"),
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
}


class BodyError(HTTPException):
    """A body that cannot be read as what it claims to be."""


def install_problem_handlers(app: FastAPI) -> None:
    """Let `app` answer every error as a problem."""
    app.add_exception_handler(RoboPromptError, _on_own_error)
    app.add_exception_handler(RequestValidationError, _on_validation_error)
    app.add_exception_handler(ValidationError, _on_validation_error)
    app.add_exception_handler(UnicodeEncodeError, _on_half_character)
    app.add_exception_handler(HTTPException, _on_http_error)
    app.add_exception_handler(Exception, _on_unexpected_error)


def problem_of(request: Request, error: Exception) -> JSONResponse:
    """The response for any error."""
    if isinstance(error, RoboPromptError):
        return own_problem(request, error)
    if isinstance(error, HTTPException):
        return _on_http_error(request, error)
    if isinstance(error, RequestValidationError | ValidationError):
        return _on_validation_error(request, error)
    return _on_unexpected_error(request, error)


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
        "detail": detail,
        "errors": list(errors),
        **extra,
    }
    return JSONResponse(content, kind.status, dict(headers or {}), media_type=MEDIA_TYPE)


def _on_own_error(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RoboPromptError)
    return own_problem(request, error)


def own_problem(request: Request, error: RoboPromptError) -> JSONResponse:
    """The response for one of the project's own errors."""
    kind = next(KINDS[cls] for cls in type(error).__mro__ if cls in KINDS)
    if kind.status >= 500:
        logger.warning("%s %s: %s: %s", request.method, request.url.path, type(error).__name__, error)
    if isinstance(error, InvalidInputError):
        return problem(kind, str(error), [_own_entry(error)])
    if isinstance(error, UnknownModelError):
        return problem(kind, str(error), [{"field": "model", "message": str(error), "valid": None}])
    if isinstance(error, UnparsableReplyError):
        return problem(kind, str(error), reply_text=error.reply_text, prediction_id=error.prediction_id)
    if isinstance(error, UnsafeReplyError):
        breach = {"field": error.action.field, "message": error.action.message, "valid": error.action.bound}
        return problem(kind, str(error), [breach], reply_text=error.reply_text, prediction_id=error.prediction_id)
    if isinstance(error, UnsupportedReplyError):
        fault = {"field": error.action.field, "message": error.action.message, "valid": error.action.expected}
        return problem(kind, str(error), [fault], reply_text=error.reply_text, prediction_id=error.prediction_id)
    wait_s = getattr(error, "retry_after_s", None) or 1.0
    headers = {"Retry-After": str(math.ceil(wait_s))} if kind.status == 503 else None
    return problem(kind, str(error), headers=headers)


def store_problem(error: StoreError) -> JSONResponse:
    """The response where not even the keys can be read."""
    kind = KINDS[StoreUnavailableError] if isinstance(error, StoreUnavailableError) else _INTERNAL
    logger.warning("the API keys cannot be read: %s", error)
    return problem(kind, "the API keys cannot be read", headers={"Retry-After": "1"})


def _own_entry(error: InvalidInputError) -> dict[str, Any]:
    return {"field": error.field, "message": error.message, "valid": error.valid}


def _on_validation_error(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError | ValidationError)
    entries = [_field_error(item) for item in error.errors()]
    detail = "; ".join(f"{entry['field']}: {entry['message']}" for entry in entries)
    return problem(KINDS[InvalidInputError], detail, entries)


def _on_half_character(request: Request, error: Exception) -> JSONResponse:
    """JSON can write half of a surrogate pair; nothing can store it or send it back."""
    assert isinstance(error, UnicodeEncodeError)
    around = error.object[max(error.start - MAX_SHOWN // 4, 0) : error.end]
    return problem(KINDS[InvalidInputError], f"the text {around!a} ends in half of a surrogate pair, expected Unicode")


def _field_error(item: Mapping[str, Any]) -> dict[str, Any]:
    """Where and what, with the value where that helps, from one of pydantic's errors."""
    own = item.get("ctx", {}).get("error")
    if isinstance(own, InvalidInputError):
        return _own_entry(own)
    location = [part for part in item["loc"] if part not in ("body", "query", "path", "header")]
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".") or "body"
    value = item.get("input")
    shown = "" if item["type"] == "missing" or isinstance(value, dict | list) else f", got {value!r}"[:MAX_SHOWN]
    expected = item.get("ctx", {}).get("expected")
    return {"field": field, "message": item["msg"] + shown, "valid": expected}


def _on_http_error(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    title = _HTTP_TITLES.get(error.status_code, "The request cannot be answered")
    kind = Kind(error.status_code, "http", title)
    return problem(kind, str(error.detail), headers=error.headers)


def _on_unexpected_error(request: Request, error: Exception) -> JSONResponse:
    logger.error("%s %s failed", request.method, request.url.path, exc_info=error)
    return problem(_INTERNAL, "An unexpected error; the service's log has the details.")
