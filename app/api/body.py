"""Request bodies -> metadata and named parts, whether multipart, JSON or MessagePack; nothing is interpreted yet.

A MessagePack document is bounded while it is unpacked.
"""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgpack
from fastapi import Request
from pydantic_core import from_json
from python_multipart.multipart import parse_options_header
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from app.api.body_limits import (
    JSON,
    MAX_DEPTH,
    MAX_VALUES,
    MSGPACK,
    MULTIPART,
    JsonBudget,
    JsonBudgetError,
    content_type_of,
)
from app.api.unique_keys import check_unique_keys, unique_members
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.npy import is_packed_array, npy_from_packed

# Lists and maps are made as long as they claim to be, before their items are read.
MAX_ITEMS = 4096
IMAGE_PREFIXES = ("rgb_", "depth_", "mask_")
TRAJECTORY = "trajectory"
MAX_PARTS = 64
UTF_8 = ("utf-8", "utf8", "us-ascii")
TINY_BYTES = 16_384  # takes less time to decode than a change of thread
_BASE64_PIECE = 4 * 262_144  # whole groups of four, 1 MB: other threads have their turn after each


class _TooManyError(Exception):
    pass


class _Counter:
    """Counts the values of each list and map that is complete; within one that is not, `MAX_ITEMS` are the most."""

    def __init__(self) -> None:
        self._left = MAX_VALUES

    def __call__(self, container: Any) -> Any:  # noqa: ANN401
        self._left -= 1 + len(container)
        if self._left < 0:
            raise _TooManyError
        return container

    def members(self, pairs: Sequence[tuple[Any, Any]]) -> dict[Any, Any]:
        """A map that is complete, as a dictionary."""
        return unique_members(self(pairs))


def unpacked(data: bytes) -> dict[str, Any]:
    """The document, its arrays as maps and its bytes as they are.

    Raises:
        HTTPException: 413 for too many values, 400 for what is not MessagePack, no map with keys of text, or a map with
            the same key twice.
    """
    counted = _Counter()
    try:
        document = msgpack.unpackb(
            data,
            max_array_len=MAX_ITEMS,
            max_map_len=MAX_ITEMS,
            max_ext_len=0,
            strict_map_key=True,
            list_hook=counted,
            object_pairs_hook=counted.members,
        )
    except HTTPException:
        raise
    except _TooManyError:
        raise HTTPException(413, f"a MessagePack document may have at most {MAX_VALUES} values") from None
    except Exception as error:  # msgpack's own errors have no common class; some are ValueError, some are not
        raise HTTPException(400, f"body is not MessagePack: {str(error)[:200] or type(error).__name__}") from None
    if not isinstance(document, dict):
        raise HTTPException(400, f"body is a MessagePack {type(document).__name__}, expected a map")
    return {_text(key, "body"): value for key, value in document.items()}


def refuse_bytes(document: dict[str, Any]) -> None:
    """Let nothing but what JSON has into the document, which is stored as such.

    Raises:
        InvalidInputError: naming the place.
    """
    if (stranger := _stranger(document, 0)) is not None:
        path, fault, valid = stranger
        place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in reversed(path))
        raise InvalidInputError(place.removeprefix(".") or "body", fault, valid)


def _stranger(value: object, depth: int) -> tuple[list[str | int], str, str] | None:
    """Where there is something that JSON has not, from within outwards, what it is, and what would be valid."""
    if depth > MAX_DEPTH:
        return [], "lies too deep", f"at most {MAX_DEPTH} levels"
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(value, dict) and not isinstance(key, str):
                return [], f"has the key {key!r:.40}", "keys that are text"
            # the place is put together only where there is a fault: keys may be long, and items many
            if (stranger := _stranger(item, depth + 1)) is not None:
                stranger[0].append(key)
                return stranger
        return None
    if isinstance(value, str | int | float | bool | None):
        return None
    return [], f"is of the type {type(value).__name__}", "what JSON can say"


def _text(key: object, where: str) -> str:
    if not isinstance(key, str):
        raise InvalidInputError(where, f"has the key {key!r:.40}", "keys that are text")
    return key


@dataclass(frozen=True)
class Body:
    """A request's content.

    Attributes:
        document: the JSON document, or that of the part `metadata`.
        parts: images, and the trajectory of a multipart upload, by name.
    """

    document: dict[str, Any]
    parts: Mapping[str, bytes]


def images_of(body: Body) -> list[bytes]:
    """Its image parts."""
    return [data for name, data in body.parts.items() if name.startswith(IMAGE_PREFIXES)]


async def read_body(request: Request, *, packed: bool = False) -> Body:
    """Read a multipart or JSON body.

    Args:
        packed: read MessagePack, too.

    Raises:
        HTTPException: 415 for another content type, 413 if it is too large, 400 if it is damaged.
        InvalidInputError: for a part that cannot be read as what its name says.
    """
    content_type = content_type_of(request.scope["headers"])
    most = request.app.state.body_limits.document
    if content_type == MULTIPART:
        return await _read_multipart(request, most)
    if content_type == JSON or (content_type == MSGPACK and packed):
        read = _read_json if content_type == JSON else _read_packed
        data = await request.body()
        return read(data, most) if len(data) <= TINY_BYTES else await run_in_threadpool(read, data, most)
    known = ", ".join([JSON, MULTIPART, *([MSGPACK] if packed else [])])
    raise HTTPException(415, f"content type {content_type or '(none)'!r:.100}: send one of {known}")


async def _read_multipart(request: Request, most: int) -> Body:
    _check_charset(request.headers["content-type"])
    parts: dict[str, bytes] = {}
    async with request.form(max_files=MAX_PARTS, max_fields=MAX_PARTS, max_part_size=most) as form:
        for name, value in form.multi_items():
            if _is_unfilled(name, value):
                continue
            if name in parts:
                raise InvalidInputError(name, "appears twice", "each part once")
            parts[name] = await value.read() if isinstance(value, UploadFile) else value.encode()
    if "metadata" not in parts:
        raise InvalidInputError("metadata", "is missing", "a part named metadata with a JSON document")
    metadata = parts.pop("metadata")
    _check_document(len(metadata), most)
    document = await run_in_threadpool(_metadata, metadata) if len(metadata) > TINY_BYTES else _metadata(metadata)
    return Body(document, parts)


def _is_unfilled(name: str, value: UploadFile | str) -> bool:
    """Whether it is an image's field of a form, Swagger UI's for one, in which no file was chosen."""
    if not name.startswith(IMAGE_PREFIXES):
        return False
    return not value.filename and not value.size if isinstance(value, UploadFile) else not value


def _check_charset(content_type: str) -> None:
    """Refuse other charsets than UTF-8: of Python's codecs some raise what no form expects, some take very long."""
    charset = parse_options_header(content_type)[1].get(b"charset", b"utf-8").decode("latin-1")
    if charset.lower() not in UTF_8:
        raise HTTPException(415, f"charset {charset!r:.100}: write the form in UTF-8")


def _metadata(data: bytes) -> dict[str, Any]:
    """A part's document; that of a whole body is counted while it comes."""
    try:
        JsonBudget().feed(data)
    except JsonBudgetError as error:
        raise HTTPException(error.status, f"metadata: {error}") from None
    return json_object(data, "metadata")


def _read_json(data: bytes, most: int) -> Body:
    document = json_object(data)
    images = {name: document.pop(name) for name in [*document] if name.startswith(IMAGE_PREFIXES)}
    if TRAJECTORY not in document:
        _check_document(len(data) - sum(len(value) for value in images.values() if isinstance(value, str)), most)
    return Body(document, {name: _base64(name, value) for name, value in images.items()})


def _read_packed(data: bytes, most: int) -> Body:
    """The document of a JSON body, its images as arrays or as encoded files."""
    document = unpacked(data)
    names = [name for name in document if name.startswith(IMAGE_PREFIXES)]
    parts = {name: _packed_image(name, document.pop(name)) for name in names}
    _check_document(len(data) - sum(map(len, parts.values())), most)
    refuse_bytes(document)
    return Body(document, parts)


def _check_document(size: int, most: int) -> None:
    if size > most:
        raise HTTPException(413, f"a document, its images aside, may have at most {most} bytes; this has {size}")


def _packed_image(name: str, value: object) -> bytes:
    if isinstance(value, bytes):
        return value
    if isinstance(value, dict) and is_packed_array(value):
        return npy_from_packed(name, value)
    raise InvalidInputError(name, f"is a {type(value).__name__}", "an array, or the image file's bytes")


def json_object(data: bytes, where: str = "body") -> dict[str, Any]:
    """The document.

    Raises:
        HTTPException: 400 for what is not JSON, no object, or one that has the same key twice, at any depth.
    """
    try:
        value = from_json(data)  # unlike json.loads it takes no half of a surrogate pair, which nothing can store
        check_unique_keys(data)
    except ValueError as error:
        raise HTTPException(400, f"{where} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise HTTPException(400, f"{where} is a JSON {type(value).__name__}, expected an object")
    return value


def _base64(name: str, value: object) -> bytes:
    if not isinstance(value, str):
        raise InvalidInputError(name, f"is a {type(value).__name__}", "the image file in base64")
    try:
        if value.find("=", 0, -2) >= 0:  # a piece of it could end there
            raise ValueError("padding before its end")
        pieces = (value[at : at + _BASE64_PIECE] for at in range(0, len(value), _BASE64_PIECE))
        return b"".join(base64.b64decode(piece, validate=True) for piece in pieces)
    except ValueError as error:  # binascii.Error is one; so is what is said of letters beyond ASCII
        raise InvalidInputError(name, f"is not base64: {error}", "the image file in base64") from None
