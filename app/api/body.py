"""Request bodies -> metadata and named parts, whether multipart, JSON or MessagePack; nothing is interpreted yet."""

import base64
import binascii
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgpack
from fastapi import Request
from pydantic_core import from_json
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from app.pipeline.errors import InvalidInputError
from app.pipeline.packed_array import is_packed_array, npy_from_packed

IMAGE_PREFIXES = ("rgb_", "depth_", "mask_")
MAX_PARTS = 64
MAX_METADATA_BYTES = 1_000_000
MULTIPART, JSON, MSGPACK = "multipart/form-data", "application/json", "application/msgpack"
# What a MessagePack document may hold, arrays' bytes aside: its lists and maps are made as long as they claim to be.
MAX_PACKED_ITEMS = 4096


@dataclass(frozen=True)
class Body:
    """A request's content.

    Attributes:
        document: the JSON document, or that of the part `metadata`.
        parts: images, and the trajectory of a multipart upload, by name.
    """

    document: dict[str, Any]
    parts: Mapping[str, bytes]


async def read_body(request: Request, *, packed: bool = False) -> Body:
    """Read a multipart or JSON body.

    Args:
        packed: read MessagePack, too.

    Raises:
        HTTPException: 415 for another content type, 400 if it is damaged.
        InvalidInputError: for a part that cannot be read as what its name says.
    """
    content_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if content_type == MULTIPART:
        return await _read_multipart(request)
    if content_type == JSON:
        return _read_json(await request.body())
    if content_type == MSGPACK and packed:
        return _read_packed(await request.body())
    known = ", ".join([JSON, MULTIPART, *([MSGPACK] if packed else [])])
    raise HTTPException(415, f"content type {content_type or '(none)'!r}: send one of {known}")


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


def _read_packed(data: bytes) -> Body:
    """The document of a JSON body, its images as arrays or as encoded files."""
    try:
        document = msgpack.unpackb(
            data, max_array_len=MAX_PACKED_ITEMS, max_map_len=MAX_PACKED_ITEMS, max_ext_len=0, strict_map_key=True
        )
    except Exception as error:  # msgpack's own errors have no common class; some are ValueError, some are not
        raise HTTPException(400, f"body is not MessagePack: {str(error)[:200] or type(error).__name__}") from None
    if not isinstance(document, dict):
        raise HTTPException(400, f"body is a MessagePack {type(document).__name__}, expected a map")
    names = [name for name in document if isinstance(name, str) and name.startswith(IMAGE_PREFIXES)]
    parts = {name: _packed_image(name, document.pop(name)) for name in names}
    _refuse_bytes(document, "body")
    return Body(document, parts)


def _packed_image(name: str, value: object) -> bytes:
    if isinstance(value, bytes):
        return value
    if isinstance(value, dict) and is_packed_array(value):
        return npy_from_packed(name, value)
    raise InvalidInputError(name, f"is a {type(value).__name__}", "an array, or the image file's bytes")


def _refuse_bytes(value: object, where: str) -> None:
    """Let nothing but what JSON has into the document, which is stored as such.

    Raises:
        InvalidInputError: naming the place.
    """
    if isinstance(value, dict):
        for key, item in value.items():
            if not isinstance(key, str):
                raise InvalidInputError(where, f"has the key {key!r:.40}", "keys that are text")
            _refuse_bytes(item, key if where == "body" else f"{where}.{key}")
    elif isinstance(value, list):
        for index, item in enumerate(value):
            _refuse_bytes(item, f"{where}[{index}]")
    elif not isinstance(value, str | int | float | bool | None):
        raise InvalidInputError(where, f"is of the type {type(value).__name__}", "what JSON can say")


def _json_object(data: bytes, where: str) -> dict[str, Any]:
    try:
        value = from_json(data)  # unlike json.loads it takes no half of a surrogate pair, which nothing can store
    except ValueError as error:
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
