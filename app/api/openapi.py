"""The parts of the OpenAPI document that FastAPI cannot know: bodies that are read by hand."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from app.api.access_rules import COOKIE, HEALTH, accepted_scopes
from app.api.problems import CONTENT
from app.api.schemas.labels import LabelBody
from app.api.schemas.poses import PosesBody
from app.api.schemas.requests import EpisodeJson, EpisodeMetadata, PredictBody
from app.api.schemas.responses import Problem

_HAND_READ = (EpisodeJson, EpisodeMetadata, LabelBody, PosesBody, PredictBody, Problem)
_BINARY = {"type": "string", "format": "binary"}
_OF_CAMERA = "of the camera that metadata names `front`, if there is one; `{kind}_NAME` of a camera NAME"
_IMAGES = {
    "rgb": f"PNG, JPEG or .npy: the colors {_OF_CAMERA.format(kind='rgb')}",
    "depth": f"16-bit PNG, or .npy in metres: the depth {_OF_CAMERA.format(kind='depth')}",
    "mask": f"16-bit PNG or .npy: ids of the objects' pixels {_OF_CAMERA.format(kind='mask')}",
}

_SCHEMES: dict[str, Any] = {
    "bearer": {"type": "http", "scheme": "bearer", "description": "a key of `roboprompt keys add`"},
    "header": {"type": "apiKey", "in": "header", "name": "X-API-Key"},
    "cookie": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "set by the login page"},
}
_STATUSES = {"401": "Unauthenticated", "403": "Forbidden", "414": "AddressTooLong", "429": "TooManyRequests"}
_MEANINGS = {
    "Unauthenticated": "keys are required, and there is none or it is not valid",
    "Forbidden": "the key lacks the scope or is for other tasks, or a page of another website asks",
    "AddressTooLong": "the address's query is too long",
    "TooManyRequests": "of this key or address; Retry-After says when to come back",
}
_REFUSALS = {name: {"description": meaning, "content": CONTENT} for name, meaning in _MEANINGS.items()}


def body_of(
    json_model: type[BaseModel], metadata_model: type[BaseModel], *files: str, packed: bool = False
) -> dict[str, Any]:
    """`openapi_extra` for a body that is one JSON document, or multipart with a part `metadata`.

    Args:
        files: names of further required parts.
        packed: MessagePack is read, too.
    """
    # Forms offer only parts with a name: those of one camera stand for those of all.
    images = {f"{kind}_front": {**_BINARY, "description": about} for kind, about in _IMAGES.items()}
    multipart = {
        "type": "object",
        "required": ["metadata", *files],
        "properties": {"metadata": _reference(metadata_model), **dict.fromkeys(files, _BINARY), **images},
        "patternProperties": {f"^{kind}_.+$": _BINARY for kind in _IMAGES},
    }
    content: dict[str, dict[str, Any]] = {
        "application/json": {"schema": _reference(json_model)},
        "multipart/form-data": {"schema": multipart, "encoding": {"metadata": {"contentType": "application/json"}}},
    }
    if packed:
        content["application/msgpack"] = {"schema": _reference(json_model)}
    return {"requestBody": {"required": True, "content": content}}


def install_openapi(app: FastAPI) -> None:
    """Let `app` describe the bodies that its routes read by hand."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = get_openapi(
                title=app.title,
                version=app.version,
                description=app.description,
                routes=app.routes,
                tags=app.openapi_tags,
            )
            _, definitions = models_json_schema(
                [(model, "validation") for model in _HAND_READ], ref_template="#/components/schemas/{model}"
            )
            _document_refusals(document)
            document.setdefault("components", {}).setdefault("schemas", {}).update(definitions["$defs"])
            _describe_access(document)
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _describe_access(document: dict[str, Any]) -> None:
    """Say of every operation which scopes let it in, and how it refuses."""
    document["components"] |= {"securitySchemes": _SCHEMES, "responses": _REFUSALS}
    for path, item in document["paths"].items():
        for method, operation in item.items():
            if scopes := sorted(accepted_scopes(method.upper(), path)):
                # The empty requirement stands for services that require no keys.
                operation["security"] = [{}, *({scheme: scopes} for scheme in _SCHEMES)]
                operation["description"] = f"{operation['description']}\n\nScope: {' or '.join(scopes)}."
            if path in HEALTH:
                continue
            named = {status: {"$ref": f"#/components/responses/{name}"} for status, name in _STATUSES.items()}
            operation["responses"] = {**named, **operation["responses"]}


# What every operation may answer, or every one with a body.
_OF_ALL = {"422": "a value is not valid", "503": "the store does not answer"}
_OF_BODIES = {"400": "the body cannot be read", "413": "the body is too large"}


def _document_refusals(document: dict[str, Any]) -> None:
    """Add the refusals that routes need not name; FastAPI's own 422 is not what the service answers."""
    for operations in document["paths"].values():
        for operation in operations.values():
            meanings = _OF_ALL | (_OF_BODIES if "requestBody" in operation else {})
            for status, meaning in meanings.items():
                named = operation["responses"].get(status)
                if named is None or ("application/json" in named["content"] and status == "422"):
                    operation["responses"][status] = {"description": meaning, "content": CONTENT}


def _reference(model: type[BaseModel]) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{model.__name__}"}
