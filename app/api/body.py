"""Request bodies -> metadata and named parts, whether multipart or JSON; nothing is interpreted yet."""

import base64
import binascii
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fastapi import Request
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from app.pipeline.errors import InvalidInputError

IMAGE_PREFIXES = ("rgb_", "depth_", "mask_")
MAX_PARTS = 64
MAX_METADATA_BYTES = 1_000_000
MULTIPART, JSON = "multipart/form-data", "application/json"


@dataclass(frozen=True)
class Body:
    """A request's content.

    Attributes:
        document: the JSON document, or that of the part `metadata`.
        parts: images, and the trajectory of a multipart upload, by name.
    """

    document: dict[str, Any]
    parts: Mapping[str, bytes]


async def read_body(request: Request) -> Body:
    """Read a multipart or JSON body.

    Raises:
        HTTPException: 415 for another content type, 400 if it is damaged.
        InvalidInputError: for a part that cannot be read as what its name says.
    """
    content_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if content_type == MULTIPART:
        return await _read_multipart(request)
    if content_type == JSON:
        return _read_json(await request.body())
    raise HTTPException(415, f"content type {content_type or '(none)'!r}: send {JSON} or {MULTIPART}")


async def _read_multipart(request: Request) -> Body:
    parts: dict[str, bytes] = {}
    async with request.form(max_files=MAX_PARTS, max_fields=MAX_PARTS, max_part_size=MAX_METADATA_BYTES) as form:
        for name, value in form.multi_items():
            if name in parts:
                raise InvalidInputError(name, "appears twice", "each part once")
            parts[name] = await value.read() if isinstance(value, UploadFile) else value.encode()
    if "metadata" not in parts:
        raise InvalidInputError("metadata", "is missing", "a part named metadata with a JSON document")
    return Body(_json_object(parts.pop("metadata"), "metadata"), parts)


def _read_json(data: bytes) -> Body:
    document = _json_object(data, "body")
    names = [name for name in document if name.startswith(IMAGE_PREFIXES)]
    return Body(document, {name: _base64(name, document.pop(name)) for name in names})


def _json_object(data: bytes, where: str) -> dict[str, Any]:
    try:
        value = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise HTTPException(400, f"{where} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise HTTPException(400, f"{where} is a JSON {type(value).__name__}, expected an object")
    return value


def _base64(name: str, value: object) -> bytes:
    if not isinstance(value, str):
        raise InvalidInputError(name, f"is a {type(value).__name__}", "the image file in base64")
    try:
        return base64.b64decode(value, validate=True)
    except binascii.Error as error:
        raise InvalidInputError(name, f"is not base64: {error}", "the image file in base64") from None
