"""The addresses of the service, by subject."""

from typing import Annotated, Any

from fastapi import Depends, Request
from pydantic import BaseModel

from app.api.problems import CONTENT
from app.services.container import Services

_BINARY = {"type": "string", "format": "binary"}
_OF_CAMERA = "image of the camera `front`, if metadata names one; `{kind}_NAME` for a camera NAME"
_IMAGES = {
    "rgb": f"PNG, JPEG or .npy: the color {_OF_CAMERA.format(kind='rgb')}",
    "depth": f"16-bit PNG, or .npy in meters: the depth {_OF_CAMERA.format(kind='depth')}",
    "mask": f"16-bit PNG or .npy: ids of the objects' pixels, the mask {_OF_CAMERA.format(kind='mask')}",
}


async def get_services(request: Request) -> Services:
    """The application's services; asynchronous, because FastAPI calls every other dependency in a thread."""
    services: Services = request.app.state.services
    return services


Wired = Annotated[Services, Depends(get_services)]


def problems(**meanings: str) -> dict[int | str, dict[str, object]]:
    """Documentation of error responses: `problems(_404="no such task")`."""
    return {int(name[1:]): {"description": meaning, "content": CONTENT} for name, meaning in meanings.items()}


def body_of(
    json_model: type[BaseModel],
    metadata_model: type[BaseModel] | None = None,
    *files: str,
) -> dict[str, Any]:
    """`openapi_extra` for a body that is one JSON document, or multipart with a part `metadata`.

    Args:
        metadata_model: None: the same.
        files: names of further required parts.
    """
    # Forms offer only parts with a name: those of one camera stand for those of all.
    images = {f"{kind}_front": {**_BINARY, "description": about} for kind, about in _IMAGES.items()}
    multipart = {
        "type": "object",
        "required": ["metadata", *files],
        "properties": {"metadata": _reference(metadata_model or json_model), **dict.fromkeys(files, _BINARY), **images},
        "patternProperties": {f"^{kind}_.+$": _BINARY for kind in _IMAGES},
    }
    content: dict[str, dict[str, Any]] = {
        "application/json": {"schema": _reference(json_model)},
        "multipart/form-data": {"schema": multipart, "encoding": {"metadata": {"contentType": "application/json"}}},
    }
    return {"requestBody": {"required": True, "content": content}}


def _reference(model: type[BaseModel]) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{model.__name__}"}
