"""The parts of the OpenAPI document that FastAPI cannot know: bodies that are read by hand."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from app.api.schemas.poses import PosesBody
from app.api.schemas.requests import EpisodeJson, EpisodeMetadata, PredictBody
from app.api.schemas.responses import Problem

_HAND_READ = (EpisodeJson, EpisodeMetadata, PosesBody, PredictBody, Problem)
_BINARY = {"type": "string", "format": "binary"}


def body_of(
    json_model: type[BaseModel], metadata_model: type[BaseModel], *files: str, packed: bool = False
) -> dict[str, Any]:
    """`openapi_extra` for a body that is one JSON document, or multipart with a part `metadata`.

    Args:
        files: names of further required parts.
        packed: MessagePack is read, too.
    """
    images = {f"{kind}_NAME": _BINARY for kind in ("rgb", "depth", "mask")}
    multipart = {
        "type": "object",
        "required": ["metadata", *files],
        "properties": {"metadata": _reference(metadata_model), **dict.fromkeys(files, _BINARY), **images},
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
            document.setdefault("components", {}).setdefault("schemas", {}).update(definitions["$defs"])
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _reference(model: type[BaseModel]) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{model.__name__}"}
